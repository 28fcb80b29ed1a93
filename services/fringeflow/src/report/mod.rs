//! The report on a run: all figures as one object, and the page that shows them.
//!
//! The page is one file that needs nothing beside itself: no network, no other file. Everything that a rig, a device or a file
//! is called reaches it as JSON alone, in which no `<` is left, and is set as text: no name can become part of the page.

mod figures;
mod html;
mod run_page;

pub(crate) use figures::{About, RunFigures, WindowLine};
pub(crate) use html::write_html;
pub(crate) use run_page::RunPage;
