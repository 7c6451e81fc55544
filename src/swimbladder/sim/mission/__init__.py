"""Missions: phases in repeated cycles, hours to years of a vehicle in real water."""
