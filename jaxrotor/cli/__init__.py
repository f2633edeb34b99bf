"""Command line: `jaxrotor scenes | show | roots | campbell | critical | response | sweep ..`."""

from .app import app as app, main as main
