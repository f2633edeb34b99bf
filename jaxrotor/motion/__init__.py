"""Motion in time: one trajectory of one scene, and the reactions of its bearings."""
