"""Tyres: the Magic Formula, its property files and the contact with the road."""
