//! The HTTP server of the page and of the metrics.
//!
//! Everything is limited: the number of connections, the size and time of a request's head, the size of its body.
//! Requests for a foreign host name, or from a page of another origin, are refused before anything else is done.

mod control;
mod guard;
mod live;
mod page;
mod server;
mod state;

pub(crate) use guard::Guard;
pub(crate) use server::{Server, bind, local_ip};
