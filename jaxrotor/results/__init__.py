"""Results as labelled arrays and tables, with units and provenance."""
