"""The vertical motion's parameters from measured logs, with what is known of their errors."""
