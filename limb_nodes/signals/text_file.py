"""The lines of a text file: a few at its start, then all of them in blocks, so that memory stays small."""

from __future__ import annotations

import codecs
import io
import os
import stat
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO

from charset_normalizer import from_bytes

from limb_nodes.errors import UserError

# The header stands in the first bytes; a line is not longer.
HEAD = 1 << 20
BLOCK = 1 << 23
_MARKS = {
    codecs.BOM_UTF8: "utf-8",
    codecs.BOM_UTF32_LE: "utf-32-le",
    codecs.BOM_UTF32_BE: "utf-32-be",
    codecs.BOM_UTF16_LE: "utf-16-le",
    codecs.BOM_UTF16_BE: "utf-16-be",
}
# Encodings of whole scripts; between those of single bytes a few signs cannot decide.
_SCRIPTS = {"shift_jis", "cp932", "euc_jp", "gb2312", "gbk", "gb18030", "big5", "euc_kr", "cp949", "johab", "cp1251"}


class TextFile:
    """A text file, opened for reading.

    Args:
        path: the file, as the user named it.
        encoding: None to conclude it from the first bytes.

    Raises UserError if there is no such file or it is no text.
    """

    def __init__(self, path: str | Path, encoding: str | None = None) -> None:
        self.source = str(path)
        self._stream = _opened(path)
        first = self._stream.read(HEAD)
        mark = next((mark for mark in _MARKS if first.startswith(mark)), b"")
        self.encoding = encoding or _encoding_of(self.source, first, mark)
        # A wrong byte spoils one sign of most encodings, and all that follow in these.
        self._errors = "strict" if self.encoding.lower().startswith(("utf-16", "utf-32")) else "replace"
        self._mark = len(mark)
        self._whole = len(first) < HEAD

    def head(self) -> list[str]:
        """The whole lines among the first bytes, without their ends. Raises UserError if a line is longer."""
        self._stream.seek(self._mark)
        text = _plain_ends(
            self._decoded(codecs.getincrementaldecoder(self.encoding)(self._errors), self._stream.read(HEAD))
        )
        lines = text.split("\n")
        rest = lines.pop()
        if rest and self._whole:
            lines.append(rest)
        if not lines and rest:
            raise UserError(f"{self.source}, line 1: is longer than {HEAD} bytes; a shorter line is needed")
        return lines

    def blocks(self, start: int) -> Iterator[bytes]:
        """The lines from `start` (counted from 0) on, in UTF-8, each with its end, block by block of whole lines.

        Raises UserError that names the line if there is a zero byte or a line is too long.
        """
        self._stream.seek(self._mark)
        decoder = codecs.getincrementaldecoder(self.encoding)(self._errors)
        plain = self.encoding.replace("-", "_") in {"utf_8", "ascii"}
        rest, line = b"", 0
        while True:
            raw = self._stream.read(BLOCK)
            text = raw if plain else self._decoded(decoder, raw, final=not raw).encode("utf-8", errors="replace")
            # The line feed of an end that a block cuts comes with the next one.
            text, rest = rest + text, b""
            if raw and text.endswith(b"\r"):
                ends = len(text) - len(text.rstrip(b"\r"))
                text, rest = text[:-ends], text[-ends:]
            text = _plain_byte_ends(text)
            if not raw and text and not text.endswith(b"\n"):
                text += b"\n"
            cut = text.rfind(b"\n") + 1
            text, rest = text[:cut], text[cut:] + rest
            if b"\0" in text:
                line += text[: text.index(b"\0")].count(b"\n")
                raise UserError(f"{self.source}, line {line + 1}: holds a zero byte; text is needed")
            if len(rest) > HEAD:
                number = line + text.count(b"\n") + 1
                raise UserError(f"{self.source}, line {number}: is longer than {HEAD} bytes; a shorter line is needed")
            count = text.count(b"\n")
            if line + count > start:
                skipped = max(0, start - line)
                yield text.split(b"\n", skipped)[-1] if skipped else text
            line += count
            if not raw:
                return

    def _decoded(self, decoder: codecs.IncrementalDecoder, raw: bytes, final: bool = False) -> str:
        try:
            return decoder.decode(raw, final)
        except UnicodeError as error:
            raise UserError(
                f"{self.source}: is no text in {self.encoding}: {error}; another encoding is needed"
            ) from None

    def close(self) -> None:
        """Close the file."""
        self._stream.close()


def _opened(path: str | Path) -> BinaryIO:
    file = Path(path)
    try:
        kind = os.stat(file).st_mode
        if stat.S_ISDIR(kind):
            raise UserError(f"{path}: is a folder; a text file is needed")
        if stat.S_ISREG(kind):
            return file.open("rb")
        if stat.S_ISFIFO(kind):
            # A pipe can be read once.
            return io.BytesIO(file.read_bytes())
    except FileNotFoundError:
        raise UserError(f"{path}: no such file") from None
    except (OSError, ValueError) as error:
        raise UserError(f"{path}: cannot be read: {getattr(error, 'strerror', error)}") from error
    raise UserError(f"{path}: is a device; a text file is needed")


def _encoding_of(source: str, first: bytes, mark: bytes) -> str:
    """The encoding of a file by its first bytes and its mark."""
    if mark:
        return _MARKS[mark]
    if b"\0" in first:
        # Text of 16 bits in which most signs are ASCII has a zero in every second byte.
        for encoding, zeros in (("utf-16-le", first[1:2000:2]), ("utf-16-be", first[:2000:2])):
            if len(zeros) > 1 and zeros.count(0) > 0.9 * len(zeros):
                return encoding
        raise UserError(f"{source}: is no text file; text, such as CSV, is needed")
    try:
        codecs.getincrementaldecoder("utf-8")().decode(first)
        return "utf-8"
    except UnicodeDecodeError:
        pass
    if sum(byte > 127 for byte in first[:10000]) >= 12:
        best = from_bytes(first[:20000]).best()
        if best is not None and best.encoding in _SCRIPTS:
            return str(best.encoding)
    # latin-1 with more signs; bytes that it leaves open are replaced.
    return "cp1252"


def _plain_ends(text: str) -> str:
    return text.replace("\r\r\n", "\n").replace("\r\n", "\n").replace("\r", "\n")


def _plain_byte_ends(text: bytes) -> bytes:
    if b"\r" not in text:
        return text
    return text.replace(b"\r\r\n", b"\n").replace(b"\r\n", b"\n").replace(b"\r", b"\n")
