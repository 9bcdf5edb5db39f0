"""Pictures of robots whose columns have long names."""

import pytest
from matplotlib.figure import Figure

from jaxid.report.figures import as_png


@pytest.mark.parametrize("rows", [1, 2, 4])
def test_labels_of_neighbouring_axes_do_not_overlap(rows):
    figure = Figure(figsize=(9, 0.8 + 0.95 * rows), layout="constrained")
    axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for ax in axes:
        ax.set_ylabel("front_left_wheel_voltage_command\n[V]")
    as_png(figure)
    boxes = [ax.yaxis.label.get_window_extent() for ax in axes]
    assert all(0 <= box.y0 and box.y1 <= figure.bbox.height for box in boxes)
    assert all(upper.y0 >= lower.y1 for upper, lower in zip(boxes, boxes[1:], strict=False))


def test_short_labels_keep_their_size():
    figure = Figure(figsize=(11.5, 4.7), layout="constrained")
    axes = figure.subplots(2, 1)
    for ax in axes:
        ax.set_ylabel("power\n[times the noise's]")
    before = [ax.yaxis.label.get_fontsize() for ax in axes]
    as_png(figure)
    assert [ax.yaxis.label.get_fontsize() for ax in axes] == before
