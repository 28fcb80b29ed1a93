// The explanations behind the question marks. One is open at a time; Escape or a click elsewhere closes it.

export function startHelp() {
    const all = [...document.querySelectorAll("details.help")];
    const closeOthers = (kept) => all.filter((help) => help !== kept).forEach((help) => (help.open = false));
    document.addEventListener("click", (event) => closeOthers(event.target.closest("details.help")));
    document.addEventListener("keydown", (event) => {
        const open = all.find((help) => help.open);
        if (event.key === "Escape" && open) {
            open.open = false;
            open.querySelector("summary").focus();
        }
    });
}
