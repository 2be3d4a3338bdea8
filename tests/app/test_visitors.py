"""Pages by their tabs: each comes back to its own view, is named for the others, and only its secret speaks for it."""

from __future__ import annotations

import asyncio
import html
import re
import time
from types import SimpleNamespace
from unittest.mock import MagicMock

import numpy as np
import pytest
from gazeloc_app.actions.choices import ChooseAlignment
from gazeloc_app.actions.history import GoToStep, Undo
from gazeloc_app.actions.jobs import CancelJob
from gazeloc_app.actions.people import MAX_NAME, PersonCame, PersonLeft
from gazeloc_app.actions.picks import PickPoint, Side
from gazeloc_app.actions.views import ShowLayer
from gazeloc_app.frames.looking import Target
from gazeloc_app.palette import PEOPLE
from gazeloc_app.panels.history import MAX_SHOWN, HistoryPanel
from gazeloc_app.panels.people import PeopleBar
from gazeloc_app.people.view_memory import MAX_BROWSERS, View, ViewMemory
from gazeloc_app.people.visitors import Visitors
from gazeloc_app.routes import Routes
from gazeloc_app.state import AppState, Layer

TAB, OTHER = "a" * 24, "b" * 24
VIEW = View((1.0, 2.0, 3.0), (0.0, 0.0, 1.0), (0.0, 0.0, 1.0), 0.9, "orbits")


class Scene:
    """The scene of one page: what is in it, by name, and how much was sent."""

    def __init__(self):
        self.nodes, self.made = {}, 0

    def _add(self, name, **values):
        self.made += 1
        self.nodes[name] = SimpleNamespace(**values, remove=lambda: self.nodes.pop(name))
        return self.nodes[name]

    def add_camera_frustum(self, name, **values):
        return self._add(name, **values)

    def add_label(self, name, text, **values):
        return self._add(name, text=text, **values)


class Client:
    """A connection as far as visitors look at it; takes note of the HTML that its page was given."""

    def __init__(self, number: int):
        self.client_id = number
        self.camera = SimpleNamespace(
            position=np.zeros(3),
            look_at=np.ones(3),
            up_direction=np.array([0.0, 0, 1]),
            fov=1.0,
            wxyz=np.array([1.0, 0, 0, 0]),
            image_width=800,
            image_height=600,
        )
        self.scene = Scene()
        self.gui = MagicMock()
        self.gui.add_html.side_effect = lambda content, **_: SimpleNamespace(content=content, visible=True)
        self.atomic = MagicMock()

    @property
    def secret(self) -> str:
        (content,) = (call.args[0] for call in self.gui.add_html.call_args_list if "hello" in call.args[0])
        return re.search(r"hello\('([\w-]+)'", content)[1]


def browser():
    made = MagicMock()
    made.tool.name, made.looking.target = "a tool", None
    return made


class Place:
    """Visitors with their routes and the state that their actions make."""

    def __init__(self, folder):
        self.state, self.actions = AppState(("walk",), "walk"), []
        self.memory = ViewMemory(folder)
        self.visitors, self.routes = Visitors(self.memory, self.dispatch), Routes()
        self.visitors.add_routes(self.routes)
        self.number = 0

    def dispatch(self, action):
        self.actions.append(action)
        self.state = action.apply(self.state)
        self.visitors.render(self.state)

    def come(self, tab=None, name=""):
        self.number += 1
        client, one = Client(self.number), browser()
        self.visitors.come(client, one, self.state)
        if tab is not None:
            assert self.ask(client.secret, f"hello?tab={tab}&name={name}") == (200, "here")
        return client, one

    @property
    def visits(self):
        return {visit.client.client_id: visit for visit in self.visitors._visits.values()}

    def bar(self, client):
        return self.visits[client.client_id].people

    def ask(self, secret, what):
        reply = asyncio.run(self.routes.answer(f"/session/{secret}/{what}"))
        return reply.status, reply.body.decode()


@pytest.fixture
def place(tmp_path):
    return Place(tmp_path)


@pytest.mark.parametrize(
    ("what", "method"),
    [("arrow", "press_arrow"), ("frame-click", "click_in_frame"), ("loupe-click", "click_in_loupe")],
)
def test_what_a_page_asks_of_keypoints_goes_to_its_own_hand_alone(place, what, method):
    client, one = place.come(TAB)
    _, other = place.come(OTHER)
    assert place.ask(client.secret, f"{what}?key=k1") == (200, "here")
    getattr(one.hand, method).assert_called_once_with({"key": "k1"})
    getattr(other.hand, method).assert_not_called()
    assert place.ask("made-up", f"{what}?key=k1") == (200, "gone")
    getattr(one.hand, method).assert_called_once()


def test_a_reload_comes_back_to_camera_tool_and_frame(place):
    client, one = place.come(TAB)
    client.camera.position, client.camera.fov = np.array([4.0, 5, 6]), 0.7
    one.tool.name, one.looking.target = "sets a point", Target("walk", 7)
    place.visitors.go(client)
    client, one = place.come(TAB)
    assert tuple(client.camera.position) == (4, 5, 6)
    assert client.camera.fov == 0.7
    one.take_again.assert_called_once_with("sets a point")
    one.look_again.assert_called_once_with("walk", 7)
    _, stranger = place.come(OTHER)
    stranger.take_again.assert_not_called()


def test_a_connection_whose_loss_is_not_known_yet_gives_its_view_to_the_next(place):
    lost, _ = place.come(TAB)
    lost.camera.position = np.array([4.0, 5, 6])
    again, _ = place.come(TAB)
    assert tuple(again.camera.position) == (4, 5, 6)
    again.camera.position = np.array([7.0, 8, 9])
    place.visitors.go(again)
    place.visitors.go(lost)  # its old view must not replace the newer one
    assert place.memory.get(TAB).position == (7, 8, 9)


def test_a_page_that_says_hello_again_stays_where_it_is(place):
    client, one = place.come(TAB)
    client.camera.position = np.array([4.0, 5, 6])
    place.visitors.remember()
    client.camera.position = np.array([7.0, 8, 9])
    assert place.ask(client.secret, f"hello?tab={TAB}&name=Ada") == (200, "here")
    assert tuple(client.camera.position) == (7, 8, 9)
    one.take_again.assert_not_called()
    assert [person.name for person in place.state.people] == ["Ada"]


def test_where_the_viewer_stands_while_a_page_is_loaded_is_not_its_view(place):
    client, _ = place.come(TAB)
    place.visitors.go(client)
    assert place.memory.get(TAB) is None
    client, one = place.come(TAB)
    one.tool.name = "sets a point"
    place.visitors.go(client)
    assert place.memory.get(TAB).tool == "sets a point"


def test_a_tool_that_was_put_down_again_is_not_in_hand_after_a_reload(place):
    _, one = place.come(TAB)
    for tool in ("sets a point", "a tool"):
        one.tool.name = tool
        place.visitors.remember()
        assert place.memory.get(TAB).tool == tool


def test_views_survive_a_restart_and_a_damaged_file_harms_nothing(place, tmp_path):
    client, _ = place.come(TAB)
    client.camera.position = np.array([4.0, 5, 6])
    place.visitors.stop()
    assert Place(tmp_path).memory.get(TAB).position == (4, 5, 6)
    for text in ("{", "[]", '{"x": {"position": [1, 2]}}', '{"x": 3}'):
        (tmp_path / ".views.json").write_text(text)
        assert Place(tmp_path).memory.get(TAB) is None


def test_a_camera_that_is_nonsense_is_not_remembered(place):
    client, _ = place.come(TAB)
    client.camera.position = np.array([np.nan, 0, 0])
    place.visitors.go(client)
    assert place.memory.get(TAB) is None


def test_only_so_many_browsers_are_remembered(tmp_path):
    memory = ViewMemory(tmp_path)
    for number in range(MAX_BROWSERS + 3):
        memory.put(f"{number:024d}", VIEW)
    assert memory.get(f"{2:024d}") is None
    assert memory.get(f"{3:024d}") == VIEW


def test_people_are_counted_named_and_gone(place):
    first, _ = place.come(TAB, "Anna")
    place.come(OTHER)
    assert [person.title for person in place.state.people] == ["Anna", "Person 2"]
    place.ask(first.secret, "name?name=%20Anna%20%20B.%20" + "x" * 100)
    assert place.state.people[0].name == ("Anna B. " + "x" * 100)[:MAX_NAME]
    place.visitors.go(first)
    assert [person.title for person in place.state.people] == ["Person 2"]
    place.come()
    assert [person.number for person in place.state.people] == [1, 2]


def test_each_page_shows_itself_as_a_field_and_others_as_text_and_names_are_escaped():
    state = AppState(("walk",), "walk")
    for action in (PersonCame(1, '"><script>'), PersonCame(2, "Bo"), PersonLeft(9)):
        state = action.apply(state)
    client = Client(1)
    bar = PeopleBar(client.gui, 2)
    bar.render(state.people, {1: "<i>a tool"})
    assert "<script>" not in bar._others.content
    assert html.escape('"><script>') in bar._others.content
    assert html.escape("<i>a tool") in bar._others.content
    assert 'value="Bo"' in bar._own.content


def test_typing_a_name_is_not_disturbed_by_what_the_others_do():
    state = PersonCame(2, "Bo").apply(AppState(("walk",), "walk"))
    bar = PeopleBar(Client(1).gui, 2)
    bar.render(state.people, {})
    before = bar._own.content
    assert not bar._others.visible
    bar.render(PersonCame(1, "Anna").apply(state).people, {1: "measures a distance"})
    assert bar._own.content == before
    assert bar._others.visible


def test_only_so_many_others_are_listed():
    state = AppState(("walk",), "walk")
    for number in range(30):
        state = PersonCame(number).apply(state)
    bar = PeopleBar(Client(1).gui, 0)
    bar.render(state.people, {})
    assert bar._others.content.count("<button") == 12
    assert "and 17 more" in bar._others.content


class TestOthersInTheScene:
    @pytest.fixture
    def two(self, place):
        (first, _), (second, one) = place.come(TAB, "Anna"), place.come(OTHER, "<b>Bo")
        second.camera.position, one.tool.name = np.array([3.0, 2, 1]), "measures a distance"
        place.visitors.render(place.state)
        return first, second

    def test_each_page_sees_where_the_other_looks_from_and_what_they_hold(self, place, two):
        first, second = two
        frustum, label = (first.scene.nodes[name] for name in ("/people/2", "/people-names/2"))
        assert tuple(frustum.position) == tuple(label.position) == (3, 2, 1)
        assert (label.text, frustum.fov) == ("<b>Bo", 1.0)
        assert frustum.color == PEOPLE[1]
        assert set(second.scene.nodes) == {"/people/1", "/people-names/1"}
        assert "measures a distance" in place.bar(first)._others.content

    def test_a_camera_that_moves_is_moved_and_not_made_anew(self, place, two):
        first, second = two
        made = first.scene.made
        second.camera.position, second.camera.wxyz = np.array([3.0, 2, 2]), np.array([0.0, 1, 0, 0])
        place.visitors._presence.show()
        frustum = first.scene.nodes["/people/2"]
        assert tuple(frustum.position) == (3, 2, 2)
        assert tuple(frustum.wxyz) == (0, 1, 0, 0)
        assert first.scene.made == made

    def test_who_stands_where_one_does_oneself_is_not_drawn_around_ones_eye(self, place, two):
        first, second = two
        second.camera.position = first.camera.position + 0.1
        place.visitors._presence.show()
        assert first.scene.nodes == {}

    @pytest.mark.parametrize(
        ("field", "value"),
        [
            ("position", np.array([np.nan, 0, 0])),
            ("wxyz", np.array([np.inf, 0, 0, 0])),
            ("wxyz", np.zeros(4)),
            ("wxyz", np.zeros(3)),
            ("image_height", np.nan),
        ],
    )
    def test_a_camera_that_is_nonsense_is_not_drawn(self, place, two, field, value):
        first, second = two
        setattr(second.camera, field, value)
        place.visitors._presence.show()
        assert first.scene.nodes == {}
        assert "/people/1" in second.scene.nodes or field == "position"

    def test_the_layer_hides_them_and_who_has_gone_is_gone(self, place, two):
        first, second = two
        place.dispatch(ShowLayer(Layer.PEOPLE, False))
        assert first.scene.nodes == {}
        place.dispatch(ShowLayer(Layer.PEOPLE, True))
        assert "/people/2" in first.scene.nodes
        place.visitors.go(second)
        assert first.scene.nodes == {}

    def test_a_click_on_a_name_goes_to_what_they_see_and_keeps_the_tool(self, place, two):
        first, second = two
        second.camera.fov = 0.6
        place.visits[2].browser.looking.target = Target("walk", 4)
        assert place.ask(first.secret, "go-to-person?number=2") == (200, "here")
        assert tuple(first.camera.position) == (3, 2, 1)
        assert first.camera.fov == 0.6
        own = place.visits[1].browser
        own.leave.assert_called_once_with()
        own.look_again.assert_called_once_with("walk", 4)
        own.take_again.assert_not_called()
        assert place.ask(first.secret, "go-to-person?number=7") == (200, "here")  # just gone
        assert tuple(first.camera.position) == (3, 2, 1)

    def test_the_thread_follows_cameras_and_sleeps_while_one_is_alone(self, place, two):
        first, second = two
        place.visitors._presence.start()
        second.camera.position = np.array([9.0, 9, 9])
        until_so(lambda: tuple(first.scene.nodes["/people/2"].position) == (9, 9, 9))
        place.visitors.go(second)
        time.sleep(0.5)
        looks = []
        place.visitors._presence.show = lambda: looks.append(1)
        time.sleep(0.6)
        assert len(looks) <= 1
        place.visitors._presence.stop()


def until_so(is_so, seconds=5.0):
    end = time.monotonic() + seconds
    while not is_so():
        assert time.monotonic() < end
        time.sleep(0.02)


@pytest.mark.parametrize(
    ("what", "action"),
    [("cancel-job?number=3", CancelJob(3)), ("go-to-step?step=0&count=4", GoToStep(0, 4))],
)
def test_a_page_asks_with_its_secret_and_nobody_without(place, what, action):
    client, _ = place.come(TAB)
    before = list(place.actions)
    assert place.ask("made-up", what) == (200, "gone")
    assert place.actions == before
    assert place.ask(client.secret, what) == (200, "here")
    assert place.actions == [*before, action]
    place.visitors.go(client)
    count = len(place.actions)
    assert place.ask(client.secret, what) == (200, "gone")
    assert len(place.actions) == count


@pytest.mark.parametrize(
    "what",
    [
        "cancel-job",
        "cancel-job?number=-1",
        "go-to-person?number=x",
        "go-to-step?step=x&count=1",
        "hello?tab=../x",
        "delete-all",
        "hello",
    ],
)
def test_what_a_page_makes_up_is_refused(place, what):
    client, _ = place.come(TAB)
    before = list(place.actions)
    assert place.ask(client.secret, what)[0] == 404
    assert place.actions == before


def steps(count):
    state = AppState(("walk",), "walk")
    for number in range(count):
        state = ChooseAlignment(f"a{number}").apply(state)
    return state


def test_going_to_a_step_keeps_all_others_and_a_list_that_changed_is_not_trusted():
    state = steps(5)
    there = GoToStep(2, 6).apply(state)
    assert there.annotation == state.past[2]
    assert (len(there.past), len(there.future)) == (2, 3)
    assert GoToStep(5, 6).apply(there).annotation == state.annotation
    for stale in (GoToStep(2, 5), GoToStep(6, 6)):
        after = stale.apply(state)
        assert after.annotation == state.annotation
        assert "changed meanwhile" in after.notice.text


def test_going_to_a_step_without_the_selected_pair_selects_one_that_is_there():
    state = PickPoint(Side.SCAN, (1, 2, 3)).apply(AppState(("walk",), "walk"))
    assert GoToStep(0, 2).apply(state).selected_key is None


def test_the_list_says_each_step_and_where_people_stand():
    client = Client(1)
    panel = HistoryPanel(client.gui, lambda action: None)
    panel.render(AppState(("walk",), "walk"))
    assert "Nothing was changed yet" in panel._list.content
    panel.render(Undo().apply(steps(3)))
    rows = re.findall(r"<button.*?gazeloc-(\w+)\".*?<span>(\d+)</span> (.*?)</button>", panel._list.content)
    assert rows == [
        ("undone", "3", "Alignment a2 put in force"),
        ("now", "2", "Alignment a1 put in force"),
        ("done", "1", "Alignment a0 put in force"),
        ("done", "0", "The beginning"),
    ]
    panel.render(steps(200))
    assert panel._list.content.count("<button") == MAX_SHOWN
    assert "141 earlier steps" in panel._list.content
