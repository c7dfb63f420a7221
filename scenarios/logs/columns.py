"""Rows of text as columns."""


def aligned(rows: list[tuple[str, ...]]) -> str:
    """Rows as columns, two spaces between them; what is longer than the header stands alone."""
    columns = len(rows[0])
    full = [row for row in rows if len(row) == columns]
    widths = [max(len(row[i]) for row in full) for i in range(columns)]
    widths[0] = max(len(row[0]) for row in rows)
    return "\n".join(
        "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=False)).rstrip()
        for row in rows
    )
