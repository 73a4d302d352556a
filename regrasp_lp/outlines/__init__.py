"""Outlines that people draw: DXF and SVG as polygons, and polygons of fewer vertices."""
