"""What `describe` says of a calibration: every number with its deviation, and how exact it is."""

import numpy as np
import pytest

from gantrytau import ModelError, describe
from gantrytau.kinematics import Kinematics
from gantrytau_models import GantryTau, prototypes
from gantrytau_optimica import Measurements, calibrate


def test_a_calibration_is_told_by_numbers_and_deviations():
    robot = GantryTau(prototypes.L1)
    rng = np.random.default_rng(1)
    r = np.array([0.5, 3.0, -0.6]) + rng.uniform(-0.3, 0.3, (40, 3))
    measured = Measurements(q=Kinematics(robot).ik(r), r=r + rng.normal(0.0, 1e-5, r.shape))
    found = calibrate(robot, measured)
    said = describe(found)
    rows = {row["name"]: row for row in said.as_mapping()["Parameters"]}
    assert float(rows["arms[1].length"]["value"]) == pytest.approx(
        found.parameters["arms[1].length"], abs=1e-6
    )
    sure = float(rows["arms[1].length"]["standard deviation"])
    assert sure == pytest.approx(found.deviations["arms[1].length"], rel=0.05)
    assert rows["arms[1].length"]["unit"] == "m"
    assert "unit" not in rows["arms[0].direction"] or not rows["arms[0].direction"]["unit"]
    assert len(eval(rows["arms[0].offset"]["standard deviation"])) == 3
    assert f"{found.error * 1e6:.3g} um" in dict(said.facts)["held out"]
    assert "arms[2].length" in found._repr_html_()
    assert describe(found, "arms[0].offset[1]").as_mapping()["unit"] == "m"
    with pytest.raises(ModelError, match=r"there is no 'arms\[0\]\.len'"):
        describe(found, "arms[0].len")
    assert "poses of 3 actuators" in measured._repr_html_()
