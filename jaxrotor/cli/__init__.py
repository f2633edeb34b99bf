"""Command line: `jaxrotor scenes | show | roots | onset | simulate | sweep`."""

from .app import app as app, main as main
