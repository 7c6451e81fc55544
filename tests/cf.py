"""What the compliance checker of IOOS says of a file, by CF 1.11: errors and warnings."""

from pathlib import Path

from compliance_checker.cf.cf_1_11 import CF1_11Check
from compliance_checker.runner import CheckSuite
from netCDF4 import Dataset


def cf_problems(written):
    """Return what is wrong with a file, or with a dataset as xarray writes it."""
    suite = CheckSuite()
    suite.checkers = {"cf:1.11": CF1_11Check}
    data = (
        Path(written).read_bytes()
        if isinstance(written, str | Path)
        else written.to_netcdf(engine="h5netcdf")
    )
    with Dataset("written.nc", memory=bytes(data)) as file:
        ((checked, raised),) = suite.run_all(file, ["cf:1.11"]).values()
    assert len(checked) > 20
    assert not raised
    return [said for one in checked if one.value[0] != one.value[1] for said in one.msgs]
