"""Methods that `against_peers.py` compares: one module a tool."""
