"""What is drawn in the 3D view: a class per layer, each shows data when told and knows nothing of the app's state.

Layers take a viser `SceneApi` (the server's, seen by all browsers, or one client's). Showing the same thing again sends
nothing. The viewer's world is the frame `scan`.
"""
