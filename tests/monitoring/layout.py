"""Finds what does not fit a page at given sizes of the window."""

# From a phone to a large screen, with the narrow and short screens between them.
SIZES = [(412, 915), (820, 1180), (1180, 820), (1280, 720), (1366, 768), (1440, 900), (1920, 1080)]


def misfits(page, sizes=SIZES):
    """Lists what is wider than the window, cut off, covered, or hidden in a table that must be scrolled."""
    found = []
    for width, height in sizes:
        page.resize(width, height)
        wrong = [*page.ask("overflows"), *page.ask("hiddenColumns")]
        wrong += [f"{text} is cut off or covered" for text in page.ask("cutTexts")]
        found += [f"at {width}×{height}: {what}" for what in wrong]
    return found


def describe(sizes=SIZES):
    return ", ".join(f"{width}×{height}" for width, height in sizes)
