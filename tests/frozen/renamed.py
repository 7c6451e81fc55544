"""What was renamed since the store was written, old -> new: the one place for it.

A name that changes gets a line here in the commit that changes it, so that the numbers behind it
go on being compared. A case that is refreshed no longer needs its lines; lines that no case needs
may go.
"""

# Commands and options as cases.py and the store have them -> as they are called today.
COMMANDS: dict[str, str] = {"bench-control": "compare-laws"}
OPTIONS: dict[str, str] = {}

# Keys of answers, columns of tables, names in TOML. Old path -> new path, both from the same
# parent: "saved": "recovered" is that key wherever it stands; "outcomes.alone":
# "outcomes.unsupervised" the key of that parent; "told": "flight.identified" goes a level down.
# "faults: saved": "recovered" is for the cases of one command only.
KEYS: dict[str, str] = {
    "faults: saved": "recovered",
    "faults: lost_alone": "lost_without_supervisor",
    "faults: rescued": "recovered_by_supervisor",
    "faults: unrecoverable_saved": "unrecoverable_surfaced",
    "faults: latch_median": "detection_time_median",
    "faults: latch_95": "detection_time_95",
    "faults: lost_share_alone": "lost_share_without_supervisor",
    "faults: lost_share_alone_of_all": "lost_share_without_supervisor_of_all",
    "faults: alone": "unsupervised",
    "faults: alone_deepest_m": "unsupervised_deepest_m",
    "faults: told": "ideal_detection",
    "ballast: unknown": "uncertainty",
    "energy: told": "fitted_efficiency",
    "energy: told_volume_m3": "fitted_volume_m3",
    "energy: told_energy_J": "fitted_energy_J",
    "energy: told_efficiency": "fitted_efficiency",
    "energy: left_out": "excluded",
    "design-experiment: pool_depth_m": "bottom_depth_m",
    "design-experiment: pool_depth": "bottom_depth",
    "energy: thruster.diameter": "thruster.diameter_m",
    "energy: thruster.idle_power": "thruster.idle_power_W",
    # Deep dives.
    "identify: book_m3": "imbalance_m3",
    "identify: book_rms_m3": "imbalance_rms_m3",
    "identify: book_over_noise": "imbalance_over_noise",
    "identify: looks": "samples",
    "identify: apart": "distance",
    "identify: worth": "tempering",
    "identify: identified.between": "identified.between",  # of vehicle.toml: as it was
    "identify: between": "random_effects",
    "neutral_walk": "random_walk",
    "tune: knobs": "tuning",
    "bench-control: left_out": "not_compared",
    "events_left_out": "events_omitted",
}

# Texts that name a kind: values of JSON, cells of tables.
KINDS: dict[str, str] = {"not told": "not identifiable"}

# Parts of the names of written files: "mission-7-told.csv": "mission-7-ideal-detection.csv".
FILES: dict[str, str] = {
    "tune.html": "report.html",
    "laws.html": "report.html",
    "wishes.png": "requirements.png",
    "-alone.csv": "-unsupervised.csv",
    "-told.csv": "-ideal_detection.csv",
}

# Identifiers in the generated C, as whole words.
C_NAMES: dict[str, str] = {}
