"""The app's panels: each a class with widgets and `render(state)`; its callbacks only dispatch actions."""
