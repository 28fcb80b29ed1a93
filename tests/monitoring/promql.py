"""What a query in PromQL names: metrics, and the values of labels."""

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
    """The names of metrics in the query: all names that are no function, label or keyword."""
    rest = STRING.sub('""', query)
    for pattern in (re.compile(r"\{[^}]*\}"), RANGE, LABELS_OF, NUMBER):
        rest = pattern.sub(" ", rest)
    names = NAME.finditer(rest)
    # A function, or `sum by (...)`, whose labels are gone, is followed by its arguments.
    return {n[0] for n in names if n[0].lower() not in KEYWORDS and not rest[n.end() :].lstrip().startswith("(")}


def matchers(query):
    """Of each `metric{label="value"}`: metric, label, operator, value."""
    for selector in SELECTOR.finditer(query):
        for label, operator, value in MATCHER.findall(selector[2]):
            yield selector[1], label, operator, value


def aliens(query, series):
    """What the query asks for and no series has, as sentences. `series`: the label sets of each metric, by its name."""
    for name in sorted(metrics(query) - series.keys()):
        yield f"there is no metric {name}"
    for name, label, operator, value in matchers(query):
        if name not in series or "$" in value:
            continue
        present = {labels[label] for labels in series[name] if label in labels}
        # Of a list of values each must be there: a misspelt one would be missed by nobody.
        for part in value.split("|") if operator in ("=~", "!~") else [value]:
            if not any(re.fullmatch(part, p) if "~" in operator else part == p for p in present):
                yield f'{name} has no {label}="{part}", only {", ".join(sorted(present)) or "none"}'
