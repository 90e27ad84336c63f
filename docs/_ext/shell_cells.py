"""Cells of a notebook that a shell runs are shown as what one types there, without the magic in front."""

from docutils import nodes

MAGIC = "%%shell\n"


def unmask(app, doctree) -> None:
    """Take the magic off and colour the rest as shell."""
    for block in doctree.findall(nodes.literal_block):
        if block.astext().startswith(MAGIC):
            block.rawsource = block.astext().removeprefix(MAGIC)
            block.children = []
            block += nodes.Text(block.rawsource)
            block["language"] = "bash"


def setup(app):
    """Look at every page that was read."""
    app.connect("doctree-read", unmask)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
