"""Pages: one self-contained HTML file each, without scripts or outside resources."""
