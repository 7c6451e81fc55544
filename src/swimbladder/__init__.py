"""swimbladder: models, identification and control of vehicles that move by changing their volume."""
__version__ = "0.1.0.dev0"
