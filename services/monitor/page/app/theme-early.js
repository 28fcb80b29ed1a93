// A script, not a module: it runs before the page is drawn, so that the other theme does not flash first.
{
    let theme = null;
    try {
        theme = localStorage.getItem("theme");
    } catch {
        // Storage may be forbidden; then the system's theme is used.
    }
    if (theme === "light" || theme === "dark") {
        document.documentElement.dataset.theme = theme;
    }
}
