// Light or dark theme: that of the system, until the user chooses another, which is remembered.

const system = matchMedia("(prefers-color-scheme: dark)");

const current = () => document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light");

/** Connects the button. `changed` is called when the colours have changed. */
export function startTheme(button, changed) {
    const updateLabel = () => {
        const other = current() === "dark" ? "light" : "dark";
        button.setAttribute("aria-label", `Change to ${other} colours`);
        button.title = `Change to ${other} colours`;
    };
    button.addEventListener("click", () => {
        const theme = current() === "dark" ? "light" : "dark";
        document.documentElement.dataset.theme = theme;
        remember(theme);
        updateLabel();
        changed();
    });
    system.addEventListener("change", () => {
        updateLabel();
        changed();
    });
    updateLabel();
}

function remember(theme) {
    try {
        localStorage.setItem("theme", theme);
    } catch {
        // Without storage, the choice lasts until the page is closed.
    }
}
