//! Serves the page and its files, which are compiled into the program.

use axum::extract::Path;
use axum::response::{IntoResponse, Response};
use http::StatusCode;
use http::header::CONTENT_TYPE;
use include_dir::{Dir, include_dir};

/// The folder `page` of this crate.
static PAGE: Dir<'_> = include_dir!("$CARGO_MANIFEST_DIR/page");

pub(super) async fn index() -> Response {
    file_response("index.html")
}

pub(super) async fn file(Path(path): Path<String>) -> Response {
    file_response(&path)
}

fn file_response(path: &str) -> Response {
    match (PAGE.get_file(path), media_type(path)) {
        (Some(file), Some(media_type)) => ([(CONTENT_TYPE, media_type)], file.contents()).into_response(),
        _ => (StatusCode::NOT_FOUND, "There is no such page.\n").into_response(),
    }
}

/// Media type of a file of the page; `None` for files that are not served, such as licences and checksums.
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

    /// Quoted names of scripts, style sheets and images.
    fn referenced_files(text: &str) -> impl Iterator<Item = &str> {
        let quoted = text.split('"').skip(1).step_by(2);
        quoted.filter(|word| [".js", ".css", ".svg"].iter().any(|ending| word.ends_with(ending)))
    }

    #[test]
    fn files_that_the_page_references_exist() {
        let index = PAGE.get_file("index.html").unwrap().contents_utf8().unwrap();
        let files: Vec<&str> = referenced_files(index).collect();
        assert!(files.len() >= 3, "{files:?}");
        for name in files {
            assert_eq!(file_response(name.trim_start_matches(['.', '/'])).status(), StatusCode::OK, "{name}");
        }
    }

    #[test]
    fn other_paths_are_not_found() {
        for path in ["../Cargo.toml", "vendor/SHA256SUMS", "", "app", "app/../index.html", "//index.html"] {
            assert_eq!(file_response(path).status(), StatusCode::NOT_FOUND, "{path}");
        }
    }
}
