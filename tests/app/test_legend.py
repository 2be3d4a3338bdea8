"""The legend names what shows, in the colours that are drawn."""

from gazeloc_app.actions.views import ColorCameras, ShowLayer, TintLayer, UseSafeColors
from gazeloc_app.palette import SAFE, UNDER, USUAL, hexadecimal
from gazeloc_app.panels.legend import legend_html
from gazeloc_app.state import AppState, Coloring, Layer

STATE = AppState(("walk",), "walk")


def legend(*actions, layers=tuple(Layer)):
    state = STATE
    for action in actions:
        state = action.apply(state)
    return legend_html(state, layers)


def entry(layer, color):
    return f'<i style="background:{hexadecimal(color)}"></i>{layer.value}<'


def test_it_has_the_colours_in_force_be_they_usual_safe_or_a_persons_own():
    assert entry(Layer.ESTIMATE, USUAL.estimate) in legend()
    assert entry(Layer.ESTIMATE, SAFE.estimate) in legend(UseSafeColors(True))
    assert entry(Layer.TRUTH, (1, 2, 3)) in legend(TintLayer(Layer.TRUTH, (1, 2, 3), 1))


def test_what_is_hidden_or_has_a_scale_of_its_own_is_left_out():
    assert Layer.GAZE.value not in legend(ShowLayer(Layer.GAZE, False))
    by_error = legend(ColorCameras(Coloring.ERROR))
    assert Layer.ESTIMATE.value not in by_error
    assert entry(Layer.TRUTH, UNDER) in by_error


def test_it_is_about_the_layers_that_have_something_to_show():
    html = legend_html(STATE, (Layer.SCAN, Layer.PHONE, Layer.GRID))
    assert html.count("<i ") == 1
    assert entry(Layer.PHONE, USUAL.phone) in html
    assert legend_html(STATE, ()) == ""
