"""What identification from logs leaves in a vehicle: how sure its numbers are, and the noise."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from swimbladder.vehicle.schema import Parameters, Unit, refusal

# As identify calls them: K1, T1, K2, T2 of eqs (22), (28), (29); masses and drag where they stand
# for these.
IdentifiedName = Literal["K1", "T1", "K2", "T2", "mass", "drag_quadratic", "psi"]
_Number = Annotated[float, Field(strict=True)]


class Between(Parameters):
    """How logs of one vehicle differ, 1 sigma: the water, what hangs on the hull, the site."""

    psi: Annotated[float, Unit("m3/m"), Field(ge=0.0)]
    """of psi: water that is warm at the top makes it smaller"""
    drag: Annotated[float, Unit(""), Field(ge=0.0)]
    """of the drag, both coefficients together, as a share"""
    neutral_drift: Annotated[float, Unit("m3/s")] = 0.0
    """mean of the neutral volume's steady growth"""
    neutral_drift_std: Annotated[float, Unit("m3/s"), Field(ge=0.0)]
    """of that growth"""
    depth_noise: Annotated[float, Unit(""), Field(ge=0.0)] = 0.0
    """of the logarithm of the depth's noise"""
    neutral_walk: Annotated[float, Unit(""), Field(ge=0.0)]
    """of the logarithm of the random walk's intensity"""
    acceleration_noise: Annotated[float, Unit(""), Field(ge=0.0)]
    """of the logarithm of the acceleration noise"""


class Identified(Parameters):
    """What was identified from logs: the covariance of numbers that stand elsewhere in this file,
    and the noise that a filter or a prediction has to allow for.
    """

    names: tuple[IdentifiedName, ...] = Field(min_length=1)
    """what was identified"""
    values: tuple[_Number, ...]
    """their values in SI, in the order of names"""
    covariance: tuple[tuple[_Number, ...], ...]
    """covariance of the values in SI, a list for each row"""
    depth_noise: Annotated[float, Unit("m"), Field(ge=0.0)] = 0.0
    """white noise of the logged depth, 1 sigma, its quantum included"""
    neutral_std: Annotated[float, Unit("m3"), Field(ge=0.0)] = 0.0
    """how far the neutral volume differs between experiments, 1 sigma"""
    neutral_walk: Annotated[float, Unit("m3/s^0.5"), Field(ge=0.0)] = 0.0
    """intensity of the neutral volume's random walk: its 1 sigma after a second"""
    acceleration_noise: Annotated[float, Unit("m/s/s^0.5"), Field(ge=0.0)] = 0.0
    """intensity of white acceleration, for what the model leaves out: 1 sigma of the speed after a
    second"""
    logs: tuple[str, ...] = ()
    """the logs that it was identified from"""
    between: Between | None = None
    """how logs of this vehicle differ"""

    def check(self) -> None:
        """Refuse fields that do not go together."""
        count = len(self.names)
        if len(set(self.names)) < count:
            raise refusal("a name stands here twice", "Name each once", "names")
        if len(self.values) != count:
            what = f"there are {len(self.values)} values for {count} names"
            raise refusal(what, "Give one value for each name", "values")
        if [len(row) for row in self.covariance] != [count] * count:
            what = f"the covariance of {count} values has {count} rows of {count}"
            raise refusal(what, "Give a list of rows", "covariance")
        self._check_covariance()

    def _check_covariance(self) -> None:
        """Refuse a matrix that is no covariance: not symmetric, or a correlation beyond 1."""
        variance = [row[i] for i, row in enumerate(self.covariance)]
        for i, row in enumerate(self.covariance):
            for j, value in enumerate(row):
                largest = (max(variance[i], 0.0) * max(variance[j], 0.0)) ** 0.5
                alike = abs(value - self.covariance[j][i]) <= 1e-6 * largest
                if variance[i] < 0.0 or not alike or abs(value) > largest * (1.0 + 1e-6):
                    what = f"no covariance: look at {self.names[i]} and {self.names[j]}"
                    remedy = (
                        "A covariance is symmetric, with variances of 0 or more on its diagonal "
                        "and correlations between -1 and 1"
                    )
                    raise refusal(what, remedy, "covariance")
