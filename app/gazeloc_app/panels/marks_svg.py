"""Keypoints over a frame in a panel, as SVG that is stretched with the picture."""

from __future__ import annotations

from collections.abc import Sequence

from gazeloc_app import palette, widgets
from gazeloc_app.frames.frame_marks import Line, Mark
from gazeloc_core.camera import Camera

CLICKED, EXPECTED, SELECTED = (palette.hexadecimal(c) for c in (palette.SCAN_SIDE, palette.SFM_SIDE, palette.SELECTED))


def marks_svg(
    marks: Sequence[Mark], lines: Sequence[Line], camera: Camera, selected: str | None, frame: int | None = None
) -> str:
    """An upright cross where a keypoint was clicked, a slanted one where it is expected, and lines; "" for none.

    With a `frame`, the recording's, clicks can be gripped by the page (static/page/frame-clicks.js).
    """
    if not marks and not lines:
        return ""
    shapes = [_line(line, selected) for line in lines]
    shapes += [_mark(mark, 0.012 * camera.width, selected, frame) for mark in marks]
    return (
        f'<svg class="gazeloc-keypoints" viewBox="0 0 {camera.width} {camera.height}" preserveAspectRatio="none" '
        f'style="position:absolute;inset:0;width:100%;height:100%;pointer-events:none">{"".join(shapes)}</svg>'
    )


def _mark(mark: Mark, arm: float, selected: str | None, frame: int | None) -> str:
    color = SELECTED if mark.key == selected else CLICKED if mark.is_clicked else EXPECTED
    x, y, a = mark.x_px, mark.y_px, arm if mark.is_clicked else 0.7 * arm
    upright = f"M{x - a:.1f} {y:.1f}h{2 * a:.1f}M{x:.1f} {y - a:.1f}v{2 * a:.1f}"
    slanted = f"M{x - a:.1f} {y - a:.1f}l{2 * a:.1f} {2 * a:.1f}M{x - a:.1f} {y + a:.1f}l{2 * a:.1f} {-2 * a:.1f}"
    what = "clicked here" if mark.is_clicked else "expected here"
    title = f"<title>{widgets.text(f'{mark.name}: {what}')}</title>"
    style = f'fill="none" stroke-width="{0.2 * arm:.1f}"'
    path = f'<path d="{upright if mark.is_clicked else slanted}" stroke="{color}" {style}>{title}</path>'
    if frame is None or not mark.is_clicked:
        return path
    names = f'data-key="{widgets.text(mark.key)}" data-frame="{frame}"'
    grip = f'<circle class="gazeloc-grip" cx="{x:.3f}" cy="{y:.3f}" r="{1.3 * arm:.1f}" {names}>{title}</circle>'
    return f"<g>{path}{grip}</g>"


def _line(line: Line, selected: str | None) -> str:
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in line.pixels.tolist())
    color = SELECTED if line.key == selected else EXPECTED
    return (
        f'<polyline points="{points}" fill="none" stroke="{color}" stroke-width="2" stroke-dasharray="8 5" '
        'vector-effect="non-scaling-stroke"/>'
    )
