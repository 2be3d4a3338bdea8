"""The door: everything that stands between a network and the app.

    who      address hosts      where the app listens, and under which names it may be asked for
             login              the token in the link, the cookie that follows from it
    what     messages uploads   which messages a page may send, and how much
             gui_values paths   which values and which folders it may name
    how much limits connection  connections, pages, messages per second; the socket that all of it is applied to

Nothing here knows the app. viser's own server is wrapped by `server.make_server`, which puts these together; it and
`door.connection` are the only ones that use private names of viser and of websockets, and each of those names has a
test in tests/app/test_server.py that fails when another version lacks it.
"""
