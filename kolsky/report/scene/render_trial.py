"""Render a sphere.

This is a separate program, because VTK may crash without a display.
"""

if __name__ == "__main__":
    import pyvista

    plotter = pyvista.Plotter(off_screen=True)
    plotter.add_mesh(pyvista.Sphere())
    plotter.screenshot()
