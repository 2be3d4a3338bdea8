"""The app: builds the server, the state, the views and the worker processes for one project, and ties them together.

browser ── callbacks ──► actions ──► Store (one loop) ──► views: panels, SceneView, each Browser
                                        └──► effects: save what people decided, start jobs
"""

from __future__ import annotations

import logging
import signal
import threading
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path

import viser

from gazeloc_app.actions.action import Notify
from gazeloc_app.actions.choices import OpenRecording
from gazeloc_app.actions.jobs import OfferJobs, StartJob
from gazeloc_app.actions.views import NameRenderer
from gazeloc_app.annotation.room_saving import RoomSaver
from gazeloc_app.annotation.saving import Saver
from gazeloc_app.browser import Browser
from gazeloc_app.browsers import Browsers
from gazeloc_app.data import ProjectData
from gazeloc_app.door.address import link_host
from gazeloc_app.door.login import needs_token, new_token
from gazeloc_app.drawing.pictures import Pictures
from gazeloc_app.drawing.render_jobs import Describe
from gazeloc_app.drawing.render_process import RenderProcess
from gazeloc_app.drawing.sources import sources_of
from gazeloc_app.frames.first_pose import FirstPose
from gazeloc_app.frames.player import Player
from gazeloc_app.frames.show_route import add_show_route
from gazeloc_app.keypoints.live_alignment import LiveAlignment
from gazeloc_app.keypoints.loupe import add_loupe_route
from gazeloc_app.looks import Look
from gazeloc_app.newest import Newest
from gazeloc_app.panels.all import Desk, Panels
from gazeloc_app.panels.help import HelpPanel
from gazeloc_app.people.view_memory import ViewMemory
from gazeloc_app.people.visitors import Visitors
from gazeloc_app.routes import Routes, add_picture_routes, add_static_route
from gazeloc_app.scene_view import SceneView
from gazeloc_app.server import make_server
from gazeloc_app.state import AppState, Level
from gazeloc_app.store import Store
from gazeloc_app.user_settings import UserSettings
from gazeloc_app.work import tasks
from gazeloc_app.work.follow_up import ScoreAfterRun
from gazeloc_app.work.job_list import JobList
from gazeloc_app.work.job_starter import JobStarter
from gazeloc_app.work.jobs import JobRunner
from gazeloc_core import pipeline
from gazeloc_core.errors import GazelocError
from gazeloc_core.project import Project

log = logging.getLogger(__name__)


class App:
    """One project in the browser, until `stop()`. Holds the project's write lock."""

    def __init__(
        self,
        project: Project,
        *,
        host: str = "127.0.0.1",
        port: int = 8080,
        allow_hosts: Sequence[str] = (),
        export_folder: Path | None = None,
    ):
        """Open the project; who comes from elsewhere than this machine needs the token that `address` carries.

        Raises:
            GazelocError: if the address is refused, the port is taken, another process writes to the project, or the
                scan or the first recording cannot be opened.
        """
        self.project = project
        self.export_folder = export_folder or project.folder / "export"
        self._link_host = link_host(host)
        self._token = new_token() if needs_token(host, allow_hosts) else None
        with ExitStack() as undo:  # what was begun is ended again where a later step is refused
            self._lock = undo.enter_context(project.lock())
            project.settle()
            self.store = Store(_empty_state(project), batch=lambda: self.server.atomic())
            self.data = ProjectData(project, self._say_damage)
            self.data.scan()
            self._saver = Saver(project, self._say_damage)
            self._job_list = JobList(project, self.export_folder, self._say_damage)
            self._room = RoomSaver(project.folder, self._say_damage)
            self._settings = UserSettings(self._say_damage)
            first = self._settings.put_into(self.store.state)
            history = self._saver.open(first.recording)
            room = self._saver.room_after_a_kill(self._room.read(history.present))
            self.store.begin(history.with_room_of(room).put_into(first))
            if first.recording:
                self.data.recording(first.recording)
            self.live = LiveAlignment(self.data, self.store.dispatch)
            self.store.dispatch(OfferJobs(self._job_list.read()))
            self.jobs = JobRunner(project.folder, self.store.dispatch)
            self._visitors = Visitors(ViewMemory(project.folder), self.store.dispatch)
            self._render = RenderProcess(sources_of(project), self._say_trouble)
            undo.callback(self._render.close)
            self.server = make_server(
                port,
                self._routes(),
                host=host,
                title=f"GazeLoc · {project.folder.name}",
                allow_hosts=allow_hosts,
                token=self._token,
            )
            undo.callback(self.server.stop)
            self.browsers = Browsers(self._make_browser, lambda client: Look(client, self.panels.handles))
            self.scene = SceneView(self.server, self.data, self._render, self.store.dispatch, self.browsers.kept)
            self.panels = Panels(self._desk())
            self._player = Player(self.data, lambda: self.store.state, self.store.dispatch)
            self._first_pose = FirstPose(self.data, self.store.dispatch)
            self._join()
            undo.pop_all()

    def _join(self) -> None:
        """Tell the store and the server whom to call; savers, views and effects are called in this order."""
        for save in (self._saver.commit, self._room.save, self._job_list.save, self._settings.save):
            self.store.add_saver(save)
        panels = [panel.render for panel in self.panels]
        for render in (self.scene.render, *panels, self.browsers.render, self._visitors.render):
            self.store.add_view(render)
        start_job = JobStarter(self.jobs, self.store.dispatch, lambda: self._saver.has_unsaved)
        for effect in (self._saver.settle, start_job, self.live.follow, self._first_pose, self._player.notice):
            self.store.add_effect(effect)
        self.server.on_client_connect(self._connected)
        self.server.on_client_disconnect(self._disconnected)

    def start(self) -> None:
        """Render everything and start the loop; load what the first click and the first picture need."""
        self._first_pose.show(self.store.state)
        self.store.add_effect(ScoreAfterRun(self.store.dispatch))
        self.store.start()
        self.live.start()
        self._player.start()
        self._visitors.start()
        threading.Thread(target=self._warm_up, name="gazeloc-warm-up", daemon=True).start()
        colors = pipeline.stage_named("colors", of_scan=True)
        if colors.is_needed(self.project) and not colors.artifact(self.project, "").exists:
            self.store.dispatch(StartJob("Colour the scan", tasks.color_scan))

    def stop(self) -> None:
        """End the loop, the worker processes and the server, and let others write to the project."""
        self.live.stop()
        self._player.stop()
        self._visitors.stop()
        self.store.stop()
        self.scene.stop()
        self.jobs.stop()
        self._render.close()
        self.server.stop()
        self._lock.release()

    @property
    def address(self) -> str:
        """What to open in the browser; holds the token where one is needed."""
        address = f"http://{self._link_host}:{self.server.get_port()}"
        return f"{address}/?token={self._token}" if self._token else address

    def run_everything(self) -> None:
        """Start the stages that are missing, as the button does."""
        self.store.dispatch(StartJob("Run everything", tasks.run_all, (("recording", self.store.state.recording),)))

    def _desk(self) -> Desk:
        return Desk(
            server=self.server,
            project=self.project,
            data=self.data,
            scene=self.scene,
            state=self.store.state,
            dispatch=self.store.dispatch,
            browser=self.browsers.get,
            open_recording=Newest(self._open_recording, "gazeloc-open").ask,
            toggle_look=self.browsers.toggle_look,
            export_folder=self.export_folder,
        )

    def _routes(self) -> Routes:
        routes = Routes()
        add_static_route(routes)
        self._visitors.add_routes(routes)
        pictures = Pictures(self.data, self._render)
        add_picture_routes(routes, pictures.frame, pictures.render, pictures.thumbnail)
        add_show_route(routes, self.data, lambda: self.store.state, self.store.dispatch)
        add_loupe_route(routes, self.data, self._render)
        return routes

    def _warm_up(self) -> None:
        try:
            self.data.raycaster().cast([[0, 0, 0]], [[0, 0, 1]])
            description = self._render.submit(Describe()).result()
            self.store.dispatch(NameRenderer(description.note))
            self.jobs.warm_up()
        except GazelocError as error:
            self.store.dispatch(Notify(Level.ERROR, str(error)))

    def _say_damage(self, sentence: str) -> None:
        self.store.dispatch(Notify(Level.ERROR, sentence))

    def _say_trouble(self, sentence: str) -> None:
        self.store.dispatch(Notify(Level.WARNING, sentence))

    def _make_browser(self, client: viser.ClientHandle) -> Browser:
        return Browser(client, self.data, self.scene, self._render, lambda: self.store.state, self.store.dispatch)

    async def _connected(self, client: viser.ClientHandle) -> None:
        browser = self.browsers.come(client)
        self.panels.of(HelpPanel).show((self.server.gui, client.gui))
        self._visitors.come(client, browser, self.store.state)

    async def _disconnected(self, client: viser.ClientHandle) -> None:
        self.browsers.go(client)
        self._visitors.go(client)

    def _open_recording(self, name: str) -> None:
        """Reads the recording's files, so not for viser's loop."""
        try:
            self.project.recording(name)
            self.data.recording(name)
            self.store.dispatch(OpenRecording(name, lambda: self._saver.open(name)))
        except GazelocError as error:
            self.store.dispatch(Notify(Level.ERROR, str(error)))


def serve(
    folder: Path,
    *,
    host: str = "127.0.0.1",
    port: int = 8080,
    allow_hosts: Sequence[str] = (),
    export_folder: Path | None = None,
    run_everything: bool = False,
) -> None:
    """Open a project in the browser and print its address; returns when the process is asked to end."""
    app = App(Project.open(folder), host=host, port=port, allow_hosts=allow_hosts, export_folder=export_folder)
    app.start()
    if run_everything:
        app.run_everything()
    print(f"GazeLoc is at {app.address} (end it with Ctrl-C)", flush=True)
    ended = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, lambda *_: ended.set())
    ended.wait()
    app.stop()


def _empty_state(project: Project) -> AppState:
    names = tuple(project.settings.recordings)
    return AppState(names, names[0] if names else "")
