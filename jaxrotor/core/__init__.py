"""Foundations without rotor models: quantities, linear blocks, checks, progress, compiled programs."""
