//! The page and its parts, which lie in the program.

use axum::extract::Path;
use axum::response::{IntoResponse, Response};
use http::StatusCode;
use http::header::CONTENT_TYPE;
use include_dir::{Dir, include_dir};

/// The folder `page` of this crate.
static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");

pub(super) async fn index() -> Response {
    part("index.html")
}

pub(super) async fn file(Path(path): Path<String>) -> Response {
    part(&path)
}

fn part(path: &str) -> Response {
    match (PAGE.get_file(path), media_type(path)) {
        (Some(file), Some(media_type)) => ([(CONTENT_TYPE, media_type)], file.contents()).into_response(),
        _ => (StatusCode::NOT_FOUND, "There is no such page.\n").into_response(),
    }
}

/// Media type of a part; `None` for what only lies beside them.
fn media_type(path: &str) -> Option<&'static str> {
    match path.rsplit_once('.')?.1 {
        "html" => Some("text/html; charset=utf-8"),
        "css" => Some("text/css; charset=utf-8"),
        "js" => Some("text/javascript; charset=utf-8"),
        "svg" => Some("image/svg+xml"),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What an attribute or an import of the page names.
    fn named(text: &str) -> impl Iterator<Item = &str> {
        let quoted = text.split('"').skip(1).step_by(2);
        quoted.filter(|word| [".js", ".css", ".svg"].iter().any(|ending| word.ends_with(ending)))
    }

    #[test]
    fn what_the_page_names_is_there() {
        let index = PAGE.get_file("index.html").unwrap().contents_utf8().unwrap();
        let parts: Vec<&str> = named(index).collect();
        assert!(parts.len() >= 3, "{parts:?}");
        for name in parts {
            assert_eq!(part(name.trim_start_matches(['.', '/'])).status(), StatusCode::OK, "{name}");
        }
    }

    #[test]
    fn nothing_else_is_served() {
        for path in ["../Cargo.toml", "vendor/SHA256SUMS", "", "app", "app/../index.html", "//index.html"] {
            assert_eq!(part(path).status(), StatusCode::NOT_FOUND, "{path}");
        }
    }
}
