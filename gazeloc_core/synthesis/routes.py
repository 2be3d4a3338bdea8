"""Where the wearer of the glasses goes and looks: two routes through the room, in the room's own coordinates."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal, TypeAlias

import numpy as np

from gazeloc_core.arrays import Floats, frozen

RouteName: TypeAlias = Literal["first", "second"]


@dataclass(frozen=True, eq=False)
class Route:
    """`eyes` (N, 4): seconds, place of the eyes; `looks` (M, 5): seconds from and to, the point that is looked at."""

    eyes: Floats
    looks: Floats

    def __post_init__(self) -> None:
        object.__setattr__(self, "eyes", frozen(self.eyes))
        object.__setattr__(self, "looks", frozen(self.looks))


ROUTES: dict[RouteName, Route] = {
    # Comes in, bends over the desk, passes the shelf and the sideboard, sits down on the sofa.
    "first": Route(
        eyes=np.array(
            [
                (0.0, 0.62, 1.64, 1.02),
                (1.8, 0.38, 1.64, 0.72),
                (3.8, 0.02, 1.63, -0.35),
                (5.4, 0.12, 1.62, -0.98),
                (6.8, 0.48, 1.44, -1.12),
                (8.0, 0.55, 1.60, -0.95),
                (9.6, 1.02, 1.64, -0.35),
                (11.2, 1.52, 1.64, 0.10),
                (12.6, 1.42, 1.63, 0.32),
                (14.4, 0.55, 1.64, 0.70),
                (16.2, -0.45, 1.64, 1.02),
                (18.0, -1.30, 1.62, 0.85),
                (19.3, -1.75, 1.36, 0.55),
                (20.4, -1.92, 1.18, 0.40),
                (22.5, -1.95, 1.17, 0.36),
            ]
        ),
        looks=np.array(
            [
                (0.0, 0.5, -2.4, 1.0, -0.1),
                (1.5, 2.0, -2.7, 1.3, -0.3),
                (3.0, 3.4, -1.0, 0.6, -0.3),
                (4.2, 4.6, -1.1, 1.3, -2.1),
                (5.7, 6.0, 0.5, 1.2, -2.1),
                (6.8, 7.3, 1.0, 0.85, -1.7),
                (8.2, 8.6, 1.7, 1.2, -2.0),
                (9.5, 9.9, 2.75, 1.3, -1.2),
                (10.8, 11.3, 2.6, 1.2, 0.1),
                (12.2, 12.5, 2.3, 1.1, 1.8),
                (13.5, 13.8, 0.9, 1.4, 2.1),
                (14.8, 15.3, -0.9, 1.3, 2.1),
                (16.2, 16.6, -1.4, 0.8, 1.8),
                (17.5, 17.8, -2.75, 1.25, 1.1),
                (18.6, 18.9, -2.7, 1.1, -0.9),
                (19.7, 20.0, -1.0, 0.9, -1.6),
                (20.8, 22.5, 0.6, 0.95, -0.9),
            ]
        ),
    ),
    # Starts by the window, crosses to the shelf, turns back, bends over the sideboard and looks round once more.
    "second": Route(
        eyes=np.array(
            [
                (0.0, -1.35, 1.62, -1.30),
                (2.0, -0.75, 1.64, -1.15),
                (4.0, 0.00, 1.64, -0.95),
                (5.6, 0.15, 1.60, -0.20),
                (7.2, 0.75, 1.55, 0.20),
                (8.8, 1.35, 1.62, -0.05),
                (10.4, 1.15, 1.64, -0.45),
                (12.0, 0.45, 1.64, 0.15),
                (13.6, 0.35, 1.60, 0.95),
                (15.2, -0.45, 1.45, 1.10),
                (16.6, -1.15, 1.50, 1.05),
                (18.2, -1.55, 1.62, 0.85),
                (19.8, -1.10, 1.64, 0.80),
                (21.4, -0.30, 1.64, 0.85),
                (22.5, 0.00, 1.64, 0.80),
            ]
        ),
        looks=np.array(
            [
                (0.0, 0.5, -0.6, 0.8, 1.9),
                (1.6, 2.0, -2.7, 1.2, 0.9),
                (3.0, 3.4, -0.86, 0.45, 0.1),
                (4.6, 5.0, 0.6, 1.4, 2.1),
                (6.0, 6.3, 1.43, 0.4, 0.92),
                (7.4, 7.8, 2.6, 1.1, 0.2),
                (9.0, 9.3, 2.75, 1.3, -1.2),
                (10.3, 10.7, 1.3, 1.3, -2.1),
                (11.8, 12.2, -1.1, 1.4, -2.1),
                (13.3, 13.7, -2.7, 1.3, -0.6),
                (15.0, 15.5, -1.0, 0.5, 1.7),
                (16.6, 17.0, -2.75, 1.2, 1.2),
                (18.6, 18.9, -1.0, 1.2, -2.1),
                (20.0, 20.3, 1.0, 1.0, -1.9),
                (21.2, 22.5, 2.7, 1.2, 0.4),
            ]
        ),
    ),
}
