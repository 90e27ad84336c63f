"""Render a sphere with VTK alone, which starts faster than PyVista.

This is a separate program, because VTK may crash without a display.
"""

if __name__ == "__main__":
    import vtkmodules.vtkRenderingOpenGL2  # noqa: F401  implements the classes below
    from vtkmodules.vtkFiltersSources import vtkSphereSource
    from vtkmodules.vtkRenderingCore import vtkActor, vtkPolyDataMapper, vtkRenderer, vtkRenderWindow

    source, mapper, actor = vtkSphereSource(), vtkPolyDataMapper(), vtkActor()
    renderer, window = vtkRenderer(), vtkRenderWindow()
    mapper.SetInputConnection(source.GetOutputPort())
    actor.SetMapper(mapper)
    renderer.AddActor(actor)
    window.SetOffScreenRendering(True)
    window.AddRenderer(renderer)
    window.Render()
    window.Finalize()  # VTK crashes if it is destroyed without
