"""Pictures: `solution` draws a simulation, `paper` the paper's figures, `linear` an analysis."""

from swimbladder.show.plots.solution import plot_solution as plot_solution
