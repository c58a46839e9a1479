"""A client's end of a WebSocket for text, with the standard library only.

Protocol: RFC 6455.
"""

import base64
import os
import socket
import struct

_TEXT, _CLOSE, _PING, _PONG = 0x1, 0x8, 0x9, 0xA


class WebSocket:
    """Connected to ws://HOST:PORT/PATH. Raises ConnectionError when the other
    end is gone, TimeoutError after `timeout` seconds of silence."""

    def __init__(self, host, port, path, timeout):
        self._socket = socket.create_connection((host, port), timeout)
        self._stream = self._socket.makefile("rb")
        key = base64.b64encode(os.urandom(16)).decode()
        self._socket.sendall(
            (f"GET {path} HTTP/1.1\r\nHost: {host}:{port}\r\n"
             "Upgrade: websocket\r\nConnection: Upgrade\r\n"
             f"Sec-WebSocket-Key: {key}\r\nSec-WebSocket-Version: 13\r\n\r\n")
            .encode())
        status = self._stream.readline()
        if b" 101 " not in status:
            raise ConnectionError(status.decode())
        while self._stream.readline().strip():
            pass  # the header ends with an empty line

    def close(self):
        self._stream.close()
        self._socket.close()

    def send(self, text):
        self._send(_TEXT, text.encode())

    def receive(self):
        """The next message."""
        message = b""
        while True:
            is_last, kind, payload = self._frame()
            if kind == _CLOSE:
                raise ConnectionError("the other end closed the socket")
            if kind == _PING:
                self._send(_PONG, payload)
            elif kind != _PONG:
                message += payload
                if is_last:
                    return message.decode()

    def _send(self, kind, payload):
        size = len(payload)  # in the 7 bits, or in the 2 or 8 bytes behind them
        short, wide = ((size, b"") if size < 126 else
                       (126, struct.pack(">H", size)) if size < 65536 else
                       (127, struct.pack(">Q", size)))
        mask = os.urandom(4)  # of all that a client sends
        masked = bytes(byte ^ mask[i % 4] for i, byte in enumerate(payload))
        self._socket.sendall(
            bytes([0x80 | kind, 0x80 | short]) + wide + mask + masked)

    def _frame(self):
        first, size = self._read(2)
        if size == 126:
            size, = struct.unpack(">H", self._read(2))
        elif size == 127:
            size, = struct.unpack(">Q", self._read(8))
        return bool(first & 0x80), first & 0xF, self._read(size)

    def _read(self, size):
        data = self._stream.read(size)
        if len(data) < size:
            raise ConnectionError("the socket ended within a frame")
        return data
