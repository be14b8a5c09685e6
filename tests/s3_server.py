"""An S3 server of this machine for tests (moto), which can refuse requests."""

from __future__ import annotations

import os
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress

Refuse = Callable[[str, str, int], int | None]
"""Method, path and number of a request (from 0) -> status of the answer, None: it is served."""
_WORDS = {403: "403 Forbidden", 500: "500 Internal Server Error", 503: "503 Slow Down"}


class S3Server:
    """Server on a free port of 127.0.0.1; `refuse` decides which requests fail, `requests` counts them."""

    def __init__(self) -> None:
        from moto.moto_server.werkzeug_app import DomainDispatcherApplication, create_backend_app
        from werkzeug.serving import make_server

        self._application = DomainDispatcherApplication(create_backend_app)
        self.refuse: Refuse = lambda method, path, number: None
        self.requests = 0
        self._server = make_server("127.0.0.1", 0, self._answer, threaded=True)
        self.url = f"http://127.0.0.1:{self._server.server_port}"
        self._thread = threading.Thread(target=self._server.serve_forever, daemon=True)
        self._thread.start()

    def _answer(self, environ, start_response):
        number = self.requests
        self.requests += 1
        status = self.refuse(environ["REQUEST_METHOD"], environ["PATH_INFO"], number)
        if status is None:
            return self._application(environ, start_response)
        environ["wsgi.input"].read(int(environ.get("CONTENT_LENGTH") or 0))
        code = {403: "AccessDenied", 500: "InternalError", 503: "SlowDown"}[status]
        body = f"<Error><Code>{code}</Code><Message>refused by the test</Message></Error>".encode()
        # without its length the client may take the body for the beginning of another answer
        start_response(_WORDS[status], [("Content-Type", "application/xml"), ("Content-Length", str(len(body)))])
        return [] if environ["REQUEST_METHOD"] == "HEAD" else [body]

    def begin(self, refuse: Refuse | None = None) -> None:
        """Count requests from 0 again, and refuse some."""
        self.requests, self.refuse = 0, refuse or (lambda method, path, number: None)

    def stop(self) -> None:
        """Shut it down; its port refuses connections then."""
        self._server.shutdown()
        self._server.server_close()
        self._thread.join()


@contextmanager
def s3_server() -> Iterator[S3Server]:
    """Yield a server with a bucket ``data`` that this process and its children take for S3."""
    import s3fs

    variables = {
        "AWS_ACCESS_KEY_ID": "test",
        "AWS_SECRET_ACCESS_KEY": "test",
        "AWS_DEFAULT_REGION": "us-east-1",
        "AWS_MAX_ATTEMPTS": "1",
        "AWS_EC2_METADATA_DISABLED": "true",
    }
    before = {name: os.environ.get(name) for name in (*variables, "AWS_ENDPOINT_URL")}
    server = S3Server()
    os.environ.update(variables, AWS_ENDPOINT_URL=server.url)
    try:
        s3fs.S3FileSystem.clear_instance_cache()
        with suppress(FileExistsError):  # of a server before: moto keeps its state in the process
            s3fs.S3FileSystem().mkdir("data")
        yield server
    finally:
        server.stop()
        s3fs.S3FileSystem.clear_instance_cache()
        for name, value in before.items():
            if value is None:
                os.environ.pop(name, None)
            else:
                os.environ[name] = value
