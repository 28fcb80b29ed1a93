// A script and no module, so that it runs before the page is drawn: a chosen theme does not flash the other first.
{
    let theme = null;
    try {
        theme = localStorage.getItem("theme");
    } catch {
        // Storage may be forbidden; then the system's theme it is.
    }
    if (theme === "light" || theme === "dark") {
        document.documentElement.dataset.theme = theme;
    }
}
