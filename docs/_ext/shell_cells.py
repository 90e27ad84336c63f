"""Shell cells of a notebook are shown as commands, without the magic at their beginning."""

from docutils import nodes

MAGIC = "%%shell\n"


def unmask(app, doctree) -> None:
    """Remove the magic and highlight the commands as shell."""
    for block in doctree.findall(nodes.literal_block):
        if block.astext().startswith(MAGIC):
            block.rawsource = block.astext().removeprefix(MAGIC)
            block.children = []
            block += nodes.Text(block.rawsource)
            block["language"] = "bash"


def setup(app):
    """Register with Sphinx: every page is processed after it is read."""
    app.connect("doctree-read", unmask)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
