"""Commands are run here whose pictures are not looked at."""

from tests.blank_pictures import blank_pictures as blank_pictures
