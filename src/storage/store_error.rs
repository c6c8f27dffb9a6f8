//! Errors of stores as sentences.
//!
//! In: a URL and the error of a store. Out: one sentence that names the URL, the fault and the remedy.

use crate::codec::text::printable;
use object_store::Error as Cause;
use std::error::Error;

/// An error about a URL.
#[derive(Debug, thiserror::Error)]
#[error("{url}: {reason}")]
pub(super) struct StoreError {
    url: String,
    reason: String,
}

impl StoreError {
    /// Returns an error about a URL.
    pub(super) fn new(url: &str, reason: impl ToString) -> Self {
        Self { url: url.to_owned(), reason: reason.to_string() }
    }

    /// Returns the error of a store about a URL.
    pub(super) fn of(url: &str, cause: &Cause) -> Self {
        let reason = match cause {
            _ if is_missing(cause) => "there is nothing of this name: check the bucket and the key".to_owned(),
            Cause::PermissionDenied { .. } => {
                "access is refused: check what the credentials in AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY may do".to_owned()
            }
            Cause::Unauthenticated { .. } => {
                "the credentials are not accepted: set AWS_ACCESS_KEY_ID and AWS_SECRET_ACCESS_KEY, or AWS_SKIP_SIGNATURE=true \
                 for what is public"
                    .to_owned()
            }
            Cause::Precondition { .. } => "it was replaced while it was read: run the command again".to_owned(),
            Cause::NotSupported { .. } | Cause::NotImplemented { .. } => {
                format!("the server does not support this ({}): name a file of another server", innermost(cause))
            }
            _ => format!(
                "the server failed or was not reached ({}): check the network, the credentials and AWS_ENDPOINT, and run the command again",
                innermost(cause)
            ),
        };
        Self::new(url, reason)
    }
}

/// Returns whether there is nothing of the name. Listings of a bucket that does not exist say so in words alone.
fn is_missing(cause: &Cause) -> bool {
    matches!(cause, Cause::NotFound { .. }) || innermost(cause).contains(" 404 ")
}

/// Returns the message of the first cause of an error, without the document that a server has sent with it.
fn innermost(error: &dyn Error) -> String {
    let mut error = error;
    while let Some(cause) = error.source() {
        error = cause;
    }
    let text = error.to_string();
    let line = text.lines().next().unwrap_or_default();
    printable(line.split_once(": <").map_or(line, |(status, _)| status))
}
