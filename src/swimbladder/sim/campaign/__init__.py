"""Campaigns: a whole array of floats on the same mission, each a little different."""
