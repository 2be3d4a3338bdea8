"""TUM files: exact times, both layouts."""

import numpy as np
from scipy.spatial.transform import Rotation

from gazeloc_core.evaluation.truth import read_tum


def test_times_keep_every_nanosecond_and_quaternions_are_xyzw(tmp_path):
    x, y, z, w = Rotation.from_rotvec([0.3, -0.2, 1.1]).as_quat()
    (tmp_path / "t.tum").write_text(
        f"# a comment\n1650316509.598345895 1 2 3 {x} {y} {z} {w}\n\n1.6503165096e+09 4 5 6 0 0 0 1\n"
        "1650316509.6000000015 0 0 0 0 0 0 1 # rounds to even\n"
    )
    times, poses = read_tum(tmp_path / "t.tum")
    assert list(times) == [1650316509598345895, 1650316509600000000, 1650316509600000002]
    np.testing.assert_allclose(poses[0].translation, [1, 2, 3])
    np.testing.assert_allclose(poses[0].rotation.as_rotvec(), [0.3, -0.2, 1.1])


def test_the_id_that_rtabmap_appends_is_ignored(tmp_path):
    (tmp_path / "t.txt").write_text("#timestamp x y z qx qy qz qw id\n1.5 1 2 3 0 0 0 1 17\n")
    times, poses = read_tum(tmp_path / "t.txt")
    assert list(times) == [1_500_000_000]
    np.testing.assert_allclose(np.atleast_2d(poses.translation), [[1, 2, 3]])
