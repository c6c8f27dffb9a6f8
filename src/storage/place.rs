//! A URL: the store that it leads to, and the path there.
//!
//! In: the text of a URL. Out: a [`Place`], or a path of this machine for `file://`; URLs of other kinds are refused.

use super::store_error::StoreError;
use object_store::aws::AmazonS3Builder;
use object_store::http::HttpBuilder;
use object_store::path::Path as Key;
use object_store::{BackoffConfig, ClientOptions, ObjectStore, RetryConfig};
use std::path::PathBuf;
use std::sync::Arc;
use std::time::Duration;
use url::{Position, Url};

/// The URLs that are understood, for messages.
const KINDS: &str = "s3://BUCKET/KEY, http(s)://HOST/PATH and file:///PATH";

/// Where a URL leads.
pub(super) enum Target {
    /// To a file or folder of this machine.
    Local(PathBuf),
    /// To a store.
    Remote(Place),
}

/// A name in a store.
#[derive(Clone)]
pub(super) struct Place {
    /// The store.
    pub store: Arc<dyn ObjectStore>,
    /// The name in the store; that of a folder ends without a slash.
    pub key: Key,
    /// The URL of the name, without a slash at its end.
    pub url: String,
    /// Whether the URL ends in a slash, and so names a folder.
    pub is_folder: bool,
    /// Whether the store lists the names that begin with a folder.
    pub lists: bool,
}

impl Target {
    /// Returns where a URL leads.
    ///
    /// # Errors
    /// A URL of another kind, or one that names nothing.
    pub(super) fn of(text: &str) -> Result<Self, StoreError> {
        let refused = |reason: &str| StoreError::new(text, reason);
        let url = Url::parse(text).map_err(|error| refused(&format!("is no URL ({error}): write {KINDS}")))?;
        if url.scheme() == "file" {
            let path = url.to_file_path();
            return path.map(Self::Local).map_err(|()| refused("is no path of this machine: write file:///PATH"));
        }
        if url.query().is_some() || url.fragment().is_some() {
            return Err(refused(
                "has a ? or a #, which are not passed on: write %3F and %23 if they are part of the name",
            ));
        }
        let key = Key::from_url_path(url.path())
            .map_err(|error| refused(&format!("has a name that cannot be used: {error}")))?;
        if key.filename().is_none() {
            return Err(refused("names no file: add its path"));
        }
        let built: Result<(Arc<dyn ObjectStore>, bool), object_store::Error> = match (url.scheme(), url.host_str()) {
            ("s3" | "s3a", Some(bucket)) => {
                let builder = AmazonS3Builder::from_env().with_bucket_name(bucket).with_retry(retries());
                builder.build().map(|store| (Arc::new(store) as _, true))
            }
            ("http" | "https", Some(_)) => {
                let options = ClientOptions::new().with_allow_http(true);
                let builder = HttpBuilder::new().with_url(&url[..Position::BeforePath]).with_client_options(options);
                builder.with_retry(retries()).build().map(|store| (Arc::new(store) as _, false))
            }
            _ => return Err(refused(&format!("is not of a kind that is understood: write {KINDS}"))),
        };
        let (store, lists) = built.map_err(|error| StoreError::of(text, &error))?;
        let is_folder = text.ends_with('/');
        Ok(Self::Remote(Place { store, key, url: text.trim_end_matches('/').to_owned(), is_folder, lists }))
    }
}

impl Place {
    /// Returns the last part of the name.
    pub(super) fn name(&self) -> &str {
        self.key.filename().unwrap_or_default()
    }

    /// Returns the URL of the folder that has this name.
    pub(super) fn parent(&self) -> &str {
        self.url.rsplit_once('/').map_or("", |(parent, _)| parent)
    }

    /// Returns the place of another name beside this one; `relative` may have folders.
    pub(super) fn beside(&self, relative: &str) -> Self {
        let parts: Vec<_> = self.key.parts().collect();
        let folder = parts.iter().take(parts.len().saturating_sub(1)).cloned();
        let key = folder.chain(relative.split('/').map(Into::into)).collect();
        Self { key, url: format!("{}/{relative}", self.parent()), is_folder: false, ..self.clone() }
    }
}

/// Returns how often and how long requests are repeated that a server fails: a few times within half a minute.
fn retries() -> RetryConfig {
    RetryConfig {
        backoff: BackoffConfig {
            init_backoff: Duration::from_millis(100),
            max_backoff: Duration::from_secs(5),
            base: 2.0,
        },
        max_retries: 6,
        retry_timeout: Duration::from_secs(30),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn remote(text: &str) -> Place {
        match Target::of(text) {
            Ok(Target::Remote(place)) => place,
            Ok(Target::Local(path)) => panic!("{text} is {}", path.display()),
            Err(error) => panic!("{error}"),
        }
    }

    #[test]
    fn names_are_decoded_and_neighbors_are_beside() {
        let place = remote("https://host:80/a%20b/c.pth");
        assert_eq!((place.key.as_ref(), place.name(), place.lists), ("a b/c.pth", "c.pth", false), "a server");
        let beside = place.beside("cfg_args");
        assert_eq!(
            (beside.key.as_ref(), beside.url.as_str()),
            ("a b/cfg_args", "https://host:80/a%20b/cfg_args"),
            "beside"
        );
        assert!(remote("https://host/a/data/").is_folder, "a slash at the end names a folder");
    }

    #[test]
    fn urls_that_lead_nowhere_are_refused_by_name() {
        for (text, reason) in [
            ("gs://bucket/a", "not of a kind"),
            ("s3://bucket", "names no file"),
            ("https://host/a?b", "not passed on"),
            ("https://", "is no URL"),
        ] {
            let message = Target::of(text).err().map(|error| error.to_string()).unwrap_or_default();
            assert!(message.starts_with(text) && message.contains(reason), "{reason} in {message:?}");
        }
        assert!(
            matches!(Target::of("file:///a/b"), Ok(Target::Local(path)) if path == PathBuf::from("/a/b")),
            "a path"
        );
    }
}
