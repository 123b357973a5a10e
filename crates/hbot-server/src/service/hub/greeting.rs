//! The first message of a connection: identifies and authorizes the client.

use hbot_api::{
    ErrorBody, ErrorCode, Hello, HelloOk, Id, Op, OpName, PROTOCOL_VERSION, Request, RequestRefusal, Response,
};
use subtle::ConstantTimeEq as _;

use super::First;
use super::Hub;

impl Hub {
    /// Handles the first message of a connection and returns how the connection continues.
    pub(in crate::service) fn first(
        &mut self,
        session: u64,
        message: Result<Request, RequestRefusal>,
    ) -> First {
        self.stats.counts.requests += 1;
        let refusal = match message {
            Ok(Request { id, op: Op::Hello(hello) }) => match self.authorize(&hello) {
                Ok(()) => return self.greet(session, id, hello),
                Err(error) => {
                    let refusal = RequestRefusal { id, op: Some(OpName::Hello), error };
                    if hello.token.is_some() {
                        self.wrong_tokens.add(self.publisher.sent_wrong_token(session));
                        return First::WrongToken(refusal);
                    }
                    refusal
                }
            },
            Ok(Request { id, op }) => {
                let message = format!("op {} before hello; legal: hello first", op.name());
                RequestRefusal { id, op: None, error: ErrorBody::new(ErrorCode::BadRequest, message) }
            }
            Err(refusal) => refusal,
        };
        self.refuse_first(session, refusal);
        First::Refused
    }

    /// Refuses the first message of a connection. The connection ends after the answer is sent.
    pub(in crate::service) fn refuse_first(
        &mut self,
        session: u64,
        RequestRefusal { id, error, .. }: RequestRefusal,
    ) {
        tracing::info!(session, code = %error.code, "no hello");
        self.respond(session, &Response::error(id, error));
        self.publisher.dismiss(session);
    }

    fn greet(&mut self, session: u64, id: Option<Id>, hello: Hello) -> First {
        let answer = HelloOk {
            server: concat!("hbot ", env!("CARGO_PKG_VERSION")).to_owned(),
            version: PROTOCOL_VERSION,
            rig: self.rig.name.clone(),
            rate_hz: f64::from(self.rig.rate_hz),
            session,
        };
        self.answer(session, id, answer);
        let Hello { name, encoding, .. } = hello;
        tracing::info!(session, name, %encoding, "hello");
        if !self.publisher.greet(session, name, encoding) {
            return First::Refused;
        }
        self.tell_status();
        First::Greeted(encoding)
    }

    fn authorize(&self, hello: &Hello) -> Result<(), ErrorBody> {
        let Some(secret) = &self.token else { return Ok(()) };
        let shown = hello.token.as_ref().map_or("", |token| token.reveal());
        // The time of this comparison reveals at most the length of the token.
        if bool::from(secret.as_bytes().ct_eq(shown.as_bytes())) {
            return Ok(());
        }
        let what = if hello.token.is_some() { "is wrong" } else { "is missing" };
        Err(ErrorBody::new(
            ErrorCode::Unauthorized,
            format!("field \"token\" {what}; see the server's token file"),
        ))
    }
}
