"""Text in the cells of tables that a spreadsheet may open."""

FORMULA = ("=", "+", "-", "@", "\t", "\r", "\n", "＝", "＋", "－", "＠")
"""What a formula may begin with for a spreadsheet, full-width forms included (OWASP, CSV Injection)."""


def text_cell(text: str) -> str:
    """Text that a spreadsheet shows and does not evaluate.

    Names come from folders and files of anybody. One that begins as a formula gets a leading apostrophe, as
    OWASP advises; a number written as text stays a number.

    Parameters
    ----------
    text
        The cell's text, not quoted yet.

    References
    ----------
    OWASP Foundation, CSV Injection, https://owasp.org/www-community/attacks/CSV_Injection.
    """
    if not text.startswith(FORMULA):
        return text
    try:
        float(text)
    except ValueError:
        return f"'{text}"
    return text
