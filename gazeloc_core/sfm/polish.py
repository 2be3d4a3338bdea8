"""The last bundle adjustment of a reconstruction: robust, and on points that more than two frames agree on.

COLMAP's own last one is plain least squares over everything. In dim rooms most points are seen by two frames only; such
a pair has one equation to spare, so that a false match bends the cameras instead of standing out. They help to register
frames and stay in the model, but the cameras are adjusted without them, and they are then placed anew. On a made-up
bare room (25 dim frames) this took the cameras from 2.8 cm and 0.58° to 1.7 cm and 0.36°.
"""

from __future__ import annotations

import copy
from collections import Counter
from typing import Any

import pycolmap

LOSS_PX = 1.0
"""Errors beyond this count ever less (Cauchy): false matches of dim frames must not weigh with their squares."""
MOST_PX = 8.0
"""Points that are off by more than this after that are no points."""
LEAST_OBSERVATIONS = 30
"""A frame with fewer of these observations keeps its points of two views: better weak than loose."""


def polish(model: Any, least_views: int) -> None:
    """Adjust cameras and points of a `pycolmap.Reconstruction` in place; its intrinsics stay.

    Points that fewer than `least_views` frames show do not move cameras, where there are others.
    """
    weak = _weak_points(model, least_views)
    if not weak:
        _adjust(model, poses=True)
        model.update_point_3d_errors()
        return
    strong = copy.deepcopy(model)
    for point_id in weak:
        strong.delete_point3D(point_id)
    _adjust(strong, poses=True)
    for frame_id in strong.reg_frame_ids():
        model.frames[frame_id].rig_from_world = strong.frames[frame_id].rig_from_world
    _adjust(model, poses=False)
    model.update_point_3d_errors()
    for point_id in [key for key, point in model.points3D.items() if point.error > MOST_PX]:
        model.delete_point3D(point_id)


def _weak_points(model: Any, least_views: int) -> list[int]:
    """The points of too few views, but those of frames that have little else."""
    views = {key: [element.image_id for element in point.track.elements] for key, point in model.points3D.items()}
    strong: Counter[int] = Counter()
    for images in views.values():
        if len(images) >= least_views:
            strong.update(images)
    return [
        key
        for key, images in views.items()
        if len(images) < least_views and all(strong[image] >= LEAST_OBSERVATIONS for image in images)
    ]


def _adjust(model: Any, poses: bool) -> None:
    options = pycolmap.BundleAdjustmentOptions()
    options.refine_focal_length = options.refine_principal_point = options.refine_extra_params = False
    options.refine_rig_from_world = poses
    options.print_summary = False
    options.ceres.loss_function_type = pycolmap.LossFunctionType.CAUCHY
    options.ceres.loss_function_scale = LOSS_PX
    config = pycolmap.BundleAdjustmentConfig()
    for image_id in model.reg_image_ids():
        config.add_image(image_id)
    if poses:
        config.fix_gauge(pycolmap.BundleAdjustmentGauge.TWO_CAMS_FROM_WORLD)
    # Not pycolmap.bundle_adjustment: that one writes to the terminal whatever the log level.
    pycolmap.create_default_bundle_adjuster(options, config, model).solve()
