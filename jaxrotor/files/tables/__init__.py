"""Readers of tables of bearings and shafts, in CSV or Excel."""

from .bearing import read_support as read_support
from .shaft import read_shaft as read_shaft
