"""Finds the metrics and label values that a PromQL query names."""

import re

KEYWORDS = {"and", "or", "unless", "bool", "inf", "nan"}
STRING = re.compile(r'"(?:[^"\\]|\\.)*"|\'[^\']*\'|`[^`]*`')
SELECTOR = re.compile(r"([a-zA-Z_:][\w:]*)\s*\{([^}]*)\}")
MATCHER = re.compile(r'(\w+)\s*(=~|!~|!=|=)\s*"((?:[^"\\]|\\.)*)"')
LABELS_OF = re.compile(r"\b(by|without|on|ignoring|group_left|group_right)\s*\([^)]*\)")
RANGE = re.compile(r"\[[^]]*\]")
NUMBER = re.compile(r"(?<![\w:])\d[\w.]*")
NAME = re.compile(r"[a-zA-Z_:][\w:]*")


def metrics(query):
    """Returns the metrics of the query: all names that are no function, label or keyword."""
    rest = STRING.sub('""', query)
    for pattern in (re.compile(r"\{[^}]*\}"), RANGE, LABELS_OF, NUMBER):
        rest = pattern.sub(" ", rest)
    names = NAME.finditer(rest)
    # Functions are followed by their arguments; so is `sum by (...)`, because its labels were removed.
    return {n[0] for n in names if n[0].lower() not in KEYWORDS and not rest[n.end() :].lstrip().startswith("(")}


def matchers(query):
    """Yields metric, label, operator and value of each `metric{label="value"}`."""
    for selector in SELECTOR.finditer(query):
        for label, operator, value in MATCHER.findall(selector[2]):
            yield selector[1], label, operator, value


def unknown_names(query, series):
    """Yields a sentence for each name that no series has. `series`: the label sets of each metric, by its name."""
    for name in sorted(metrics(query) - series.keys()):
        yield f"there is no metric {name}"
    for name, label, operator, value in matchers(query):
        if name not in series or "$" in value:
            continue
        present = {labels[label] for labels in series[name] if label in labels}
        # Each value of a list must exist: nothing else would reveal a misspelt one.
        for part in value.split("|") if operator in ("=~", "!~") else [value]:
            if not any(re.fullmatch(part, p) if "~" in operator else part == p for p in present):
                yield f'{name} has no {label}="{part}", only {", ".join(sorted(present)) or "none"}'
