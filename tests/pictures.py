"""What tests read of pictures."""

import numpy as np

from swimbladder.show.picture import Curve, Note


def marks(panel, kind, label=None):
    """The marks of a kind in a panel, those of a label."""
    return [m for m in panel.marks if isinstance(m, kind) and label in (None, m.label)]


def curve(panel, label):
    """The points of the one curve of a label."""
    (found,) = marks(panel, Curve, label)
    return np.column_stack([found.x, found.y])


def texts(panel):
    """What is written inside a panel."""
    return [note.text for note in panel.marks if isinstance(note, Note)]
