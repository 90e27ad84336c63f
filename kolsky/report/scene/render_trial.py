"""Render a sphere: run as a program of its own, because VTK may crash where there is no display."""

if __name__ == "__main__":
    import pyvista

    plotter = pyvista.Plotter(off_screen=True)
    plotter.add_mesh(pyvista.Sphere())
    plotter.screenshot()
