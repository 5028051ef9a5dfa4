//! Batches in each provider's format: submission, end, and results.
//!
//! <https://platform.claude.com/docs/en/build-with-claude/batch-processing>, <https://platform.openai.com/docs/guides/batch>,
//! <https://ai.google.dev/gemini-api/docs/batch-api>

use std::collections::HashMap;

use reqwest::header::CONTENT_TYPE;
use reqwest::{Client, RequestBuilder, StatusCode, Url};
use serde_json::{Value, json};

use super::super::failure::{Failure, broken, failed, server, shortened};
use super::super::rate_limit::{retry_after, retry_info};
use super::super::whole;
use crate::agent::vlm::wire_format::Dialect;

/// Separates the parts of an uploaded file. A JSON line contains no line feed, so no line begins with it.
const BOUNDARY: &str = "mirrorstats-batch-of-requests";

/// The status and body of a batched request's answer, or a failure.
pub(super) type Ended = Result<(StatusCode, Value), Failure>;

#[derive(Debug)]
pub(super) struct Service {
    pub(super) client: Client,
    /// The endpoint of single requests.
    pub(super) url: Url,
    pub(super) dialect: Dialect,
    pub(super) largest_answer: usize,
}

impl Service {
    /// The maximum bytes of a batch, below the provider's limit: 256 MB, 200 MB, and 20 MB for inline requests.
    pub(super) const fn most_bytes(&self) -> usize {
        match self.dialect {
            Dialect::Gemini => 16 << 20,
            _ => 64 << 20,
        }
    }

    /// Submits named requests; returns the name of the batch.
    pub(super) async fn submit(&self, requests: &[(String, Value)]) -> Result<String, Failure> {
        let list = |one: fn(&str, &Value) -> Value| requests.iter().map(|(id, body)| one(id, body)).collect::<Vec<_>>();
        match self.dialect {
            Dialect::AnthropicMessages => {
                let all = list(|id, body| json!({ "custom_id": id, "params": body }));
                self.create(&["messages", "batches"], &json!({ "requests": all }), "id").await
            }
            Dialect::Gemini => {
                let all = list(|id, body| json!({ "request": body, "metadata": { "key": id } }));
                let input = json!({ "requests": { "requests": all } });
                let batch = json!({ "batch": { "displayName": "mirrorstats", "inputConfig": input } });
                let method = self.url.path_segments().and_then(|mut segments| segments.next_back()).unwrap_or_default();
                let method = method.replace(":generateContent", ":batchGenerateContent");
                self.create(&["models", &method], &batch, "name").await
            }
            Dialect::OpenaiChat | Dialect::OpenaiCompatible => {
                const ENDPOINT: &str = "/v1/chat/completions";
                let lines =
                    list(|id, body| json!({ "custom_id": id, "method": "POST", "url": ENDPOINT, "body": body }));
                let text = lines.iter().map(Value::to_string).collect::<Vec<_>>().join("\n") + "\n";
                // A file without a batch is not billed.
                let file = self.upload(&text).await.map_err(|failure| Failure { may_be_paid: false, ..failure })?;
                let batch = json!({ "input_file_id": file, "endpoint": ENDPOINT, "completion_window": "24h" });
                self.create(&["batches"], &batch, "id").await
            }
        }
    }

    /// The results of a batch's requests, without those that the provider does not name; `None` while it is under way.
    /// `ids` are in the order of submission.
    pub(super) async fn ended(&self, batch: &str, ids: &[String]) -> Result<Option<HashMap<String, Ended>>, Failure> {
        match self.dialect {
            Dialect::AnthropicMessages => self.ended_of_anthropic(batch, ids.len()).await,
            Dialect::Gemini => self.ended_of_gemini(batch, ids).await,
            Dialect::OpenaiChat | Dialect::OpenaiCompatible => self.ended_of_openai(batch, ids).await,
        }
    }

    async fn ended_of_anthropic(&self, batch: &str, count: usize) -> Result<Option<HashMap<String, Ended>>, Failure> {
        let path = ["messages", "batches", batch];
        if self.get(&path).await?["processing_status"] != "ended" {
            return Ok(None);
        }
        let results = self.lines(&[&path[..], &["results"]].concat(), count).await?;
        Ok(Some(results.into_iter().filter_map(|line| of_anthropic(&line)).collect()))
    }

    async fn ended_of_openai(&self, batch: &str, ids: &[String]) -> Result<Option<HashMap<String, Ended>>, Failure> {
        let state = self.get(&["batches", batch]).await?;
        let status = state["status"].as_str().unwrap_or_default();
        if status == "failed" {
            let fault = &state["errors"]["data"][0];
            // The account's queue of batches is full: the end of another batch makes room.
            let is_full = fault["code"] == "token_limit_exceeded";
            let code = if is_full { StatusCode::TOO_MANY_REQUESTS } else { StatusCode::BAD_REQUEST };
            return Ok(Some(all_of(ids, &failed(code, None, &fault.to_string()))));
        }
        if !["completed", "expired", "cancelled"].contains(&status) {
            return Ok(None);
        }
        let mut ended = HashMap::new();
        for key in ["output_file_id", "error_file_id"] {
            if let Some(file) = state[key].as_str() {
                let lines = self.lines(&["files", file, "content"], ids.len()).await?;
                ended.extend(lines.iter().filter_map(of_openai));
            }
        }
        Ok(Some(ended))
    }

    async fn ended_of_gemini(&self, batch: &str, ids: &[String]) -> Result<Option<HashMap<String, Ended>>, Failure> {
        let path = ["batches", batch.trim_start_matches("batches/")];
        let text = self.fetch(self.client.get(self.at(&path)), ids.len().saturating_add(1)).await?;
        let operation: Value = serde_json::from_str(&text).unwrap_or_default();
        let state = operation["metadata"]["state"].as_str().unwrap_or_default();
        let is_over = ["_SUCCEEDED", "_FAILED", "_CANCELLED", "_EXPIRED"].iter().any(|end| state.ends_with(end));
        if operation["done"] != true && !is_over {
            return Ok(None);
        }
        let responses = [&operation["response"], &operation["metadata"]["output"]]
            .map(|output| &output["inlinedResponses"]["inlinedResponses"]);
        let Some(responses) = responses.into_iter().find_map(Value::as_array) else {
            let failure = match operation.get("error") {
                Some(error) => failed(http_status(error), None, &error.to_string()),
                None => unpaid(&format!("the batch ended as {state} without a result")),
            };
            return Ok(Some(all_of(ids, &failure)));
        };
        // Answers are in the order of the requests, and not always named.
        let named = responses.iter().enumerate().filter_map(|(at, one)| {
            let id = one["metadata"]["key"].as_str().or_else(|| ids.get(at).map(String::as_str))?;
            Some((id.to_owned(), of_gemini(one)))
        });
        Ok(Some(named.collect()))
    }

    async fn upload(&self, text: &str) -> Result<String, Failure> {
        let part = format!("--{BOUNDARY}\r\ncontent-disposition: form-data; name=");
        let body = format!(
            "{part}\"purpose\"\r\n\r\nbatch\r\n{part}\"file\"; filename=\"requests.jsonl\"\r\n\
             content-type: application/jsonl\r\n\r\n{text}\r\n--{BOUNDARY}--\r\n"
        );
        let kind = format!("multipart/form-data; boundary={BOUNDARY}");
        let post = self.client.post(self.at(&["files"])).header(CONTENT_TYPE, kind).body(body);
        self.named(post, "id").await
    }

    async fn create(&self, path: &[&str], body: &Value, name: &str) -> Result<String, Failure> {
        self.named(self.client.post(self.at(path)).json(body), name).await
    }

    async fn named(&self, post: RequestBuilder, name: &str) -> Result<String, Failure> {
        let text = self.fetch(post, 1).await?;
        let made: Value = serde_json::from_str(&text).unwrap_or_default();
        let found = made[name].as_str().map(str::to_owned);
        found.ok_or_else(|| server(format!("expected a batch with `{name}`, found: {}", shortened(&text))))
    }

    async fn get(&self, path: &[&str]) -> Result<Value, Failure> {
        let text = self.fetch(self.client.get(self.at(path)), 1).await?;
        Ok(serde_json::from_str(&text).unwrap_or_default())
    }

    async fn lines(&self, path: &[&str], answers: usize) -> Result<Vec<Value>, Failure> {
        let text = self.fetch(self.client.get(self.at(path)), answers).await?;
        Ok(text.lines().filter_map(|line| serde_json::from_str(line).ok()).collect())
    }

    async fn fetch(&self, request: RequestBuilder, answers: usize) -> Result<String, Failure> {
        let response = request.send().await.map_err(broken)?;
        let (status, after) = (response.status(), retry_after(response.headers()));
        let bytes = whole(response, self.largest_answer.saturating_mul(answers)).await?;
        let text = String::from_utf8_lossy(&bytes).into_owned();
        if status.is_success() { Ok(text) } else { Err(failed(status, after.or_else(|| retry_info(&text)), &text)) }
    }

    fn at(&self, path: &[&str]) -> Url {
        let mut url = self.url.clone();
        if let Ok(mut segments) = url.path_segments_mut() {
            for _ in self.dialect.path("").split('/') {
                segments.pop();
            }
            segments.extend(path);
        }
        url
    }
}

fn all_of(ids: &[String], failure: &Failure) -> HashMap<String, Ended> {
    ids.iter().map(|id| (id.clone(), Err(failure.clone()))).collect()
}

/// A failure that the provider does not bill.
pub(super) fn unpaid(detail: &str) -> Failure {
    Failure { may_be_paid: false, ..server(detail.to_owned()) }
}

fn of_anthropic(line: &Value) -> Option<(String, Ended)> {
    let result = &line["result"];
    let ended = match result["type"].as_str() {
        Some("succeeded") => Ok((StatusCode::OK, result["message"].clone())),
        Some("errored") => Ok((status_of(&result["error"]), result["error"].clone())),
        how => Err(unpaid(&format!("a request of the batch ended as {}", how.unwrap_or("nothing known")))),
    };
    Some((line["custom_id"].as_str()?.to_owned(), ended))
}

fn of_openai(line: &Value) -> Option<(String, Ended)> {
    let response = &line["response"];
    let status = response["status_code"].as_u64().and_then(|code| StatusCode::from_u16(u16::try_from(code).ok()?).ok());
    let ended = match status {
        Some(status) => Ok((status, response["body"].clone())),
        None => Err(unpaid(&format!("a request of the batch ended without an answer: {}", line["error"]))),
    };
    Some((line["custom_id"].as_str()?.to_owned(), ended))
}

fn of_gemini(one: &Value) -> Ended {
    match (one.get("response"), one.get("error")) {
        (Some(body), _) => Ok((StatusCode::OK, body.clone())),
        (None, Some(error)) => Ok((http_status(error), json!({ "error": error }))),
        (None, None) => Err(unpaid("a request of the batch ended without an answer")),
    }
}

/// The HTTP status of this error outside of batches: <https://platform.claude.com/docs/en/api/errors>.
fn status_of(error: &Value) -> StatusCode {
    match error["error"]["type"].as_str() {
        Some("authentication_error") => StatusCode::UNAUTHORIZED,
        Some("permission_error") => StatusCode::FORBIDDEN,
        Some("not_found_error") => StatusCode::NOT_FOUND,
        Some("rate_limit_error") => StatusCode::TOO_MANY_REQUESTS,
        Some("api_error") => StatusCode::INTERNAL_SERVER_ERROR,
        Some("overloaded_error") => StatusCode::from_u16(529).unwrap_or(StatusCode::SERVICE_UNAVAILABLE),
        _ => StatusCode::BAD_REQUEST,
    }
}

/// The HTTP status for a code of google/rpc/code.proto.
fn http_status(error: &Value) -> StatusCode {
    match error["code"].as_u64() {
        Some(3 | 9 | 11) => StatusCode::BAD_REQUEST,
        Some(5) => StatusCode::NOT_FOUND,
        Some(7) => StatusCode::FORBIDDEN,
        Some(16) => StatusCode::UNAUTHORIZED,
        Some(8) => StatusCode::TOO_MANY_REQUESTS,
        Some(14) => StatusCode::SERVICE_UNAVAILABLE,
        Some(4) => StatusCode::GATEWAY_TIMEOUT,
        Some(code @ 400..) => {
            let status = u16::try_from(code).ok().and_then(|code| StatusCode::from_u16(code).ok());
            status.unwrap_or(StatusCode::INTERNAL_SERVER_ERROR)
        }
        _ => StatusCode::INTERNAL_SERVER_ERROR,
    }
}
