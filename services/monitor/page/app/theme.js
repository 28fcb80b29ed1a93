// Light or dark: the system's choice until the operator makes another, which then stays.

const system = matchMedia("(prefers-color-scheme: dark)");

const current = () => document.documentElement.dataset.theme ?? (system.matches ? "dark" : "light");

/** Wires the toggle; `changed` is called whenever colours have become others. */
export function startTheme(button, changed) {
    const label = () => {
        const other = current() === "dark" ? "light" : "dark";
        button.setAttribute("aria-label", `Change to ${other} colours`);
        button.title = `Change to ${other} colours`;
    };
    button.addEventListener("click", () => {
        const theme = current() === "dark" ? "light" : "dark";
        document.documentElement.dataset.theme = theme;
        remember(theme);
        label();
        changed();
    });
    system.addEventListener("change", () => {
        label();
        changed();
    });
    label();
}

function remember(theme) {
    try {
        localStorage.setItem("theme", theme);
    } catch {
        // Without storage the choice lasts as long as the page.
    }
}
