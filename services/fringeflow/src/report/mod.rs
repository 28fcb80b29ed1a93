//! The report on a run: all figures as one object, and the HTML page that shows them.
//!
//! The page is a single file. It loads nothing, from the network or from other files. Names of rigs, devices and files
//! reach it only as JSON in which `<` is escaped, and the script sets them as text. So no name can become markup or
//! code.

mod figures;
mod html;
mod markup;
mod run_page;

pub(crate) use figures::{RunFigures, RunInfo, StageLine, WindowLine};
pub(crate) use html::write_html;
pub(crate) use markup::{COMMON_STYLE, FRAME_STYLE, escaped};
pub(crate) use run_page::RunPage;
