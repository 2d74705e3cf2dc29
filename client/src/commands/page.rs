//! `karst page`: where the server's live page is, with the token that opens it.

use karst_client::Error;
use serde_json::json;

use crate::args::ServerArgs;
use crate::talk::Talk;

pub(super) async fn run(args: ServerArgs, talk: Talk) -> Result<(), Error> {
    // Nobody is sent to a page that is not there.
    args.connect().await?;
    // What follows the # stays in the browser.
    let address = format!("{}/#token={}", args.server.trim_end_matches('/'), args.bearer()?.token());
    talk.result(&address, &json!({"page": address}));
    Ok(())
}
