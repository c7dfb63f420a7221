"""Looks through the blocks of an MDF 4 file before anything is read of it.

Readers follow the links between blocks and believe the sizes in them. Here every block is known to
lie in the file, lists to end, and what is declared and compressed to fit. Layout of the blocks:
ASAM MDF 4.1, sections 5.4 to 5.32.
"""

import mmap
import struct
import zlib
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, NoReturn

from twin.errors import TwinError
from twin.logs.raw_log import LARGEST_LOG, check_file_size, check_size
from twin.toml_file import reason

MOST_BLOCKS = 1_000_000
_HEADER = struct.Struct("<4sIQQ")  # id, reserved, length, number of links
_FIRST = 64  # address of the header's block

# Links that make lists and trees: nothing is reached twice by them
_TREE = {
    b"##HD": (0, 1, 2, 3, 4),
    b"##DG": (0, 1, 2),
    b"##CG": (0, 1),
    b"##CN": (0, 1),
    b"##CA": (0,),
    b"##FH": (0,),
    b"##AT": (0,),
    b"##EV": (0,),
    b"##CH": (0, 1),
    b"##HL": (0,),
}
_LISTS_OF_DATA = (b"##DL", b"##LD")  # all links of these


class _Block(NamedTuple):
    address: int
    kind: bytes
    length: int
    links: tuple[int, ...]


def check_mdf(path: Path) -> None:
    """Raises TwinError unless a file is an MDF 4 file whose blocks can be followed."""
    check_file_size(path)
    try:
        with path.open("rb") as file:
            if path.stat().st_size < _FIRST + _HEADER.size:
                raise TwinError(f"{path}: is no MDF 4 file: it ends within the header")
            with mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
                _check(path, content)
    except OSError as error:
        raise TwinError(f"{path}: cannot be read: {reason(error)}") from error


def _check(path: Path, content: mmap.mmap) -> None:
    if content[:8] not in (b"MDF     ", b"UnFinMF "):
        raise TwinError(f"{path}: is no MDF file; allowed: MDF 4")
    if content[8:10] != b"4.":
        version = content[8:16].decode("latin-1").strip("\0 ")
        raise TwinError(f"{path}: is MDF {version!r}; allowed: MDF 4")
    declared = unpacked = 0
    for block in _blocks(path, content):
        start = block.address + _HEADER.size + 8 * len(block.links)
        if block.kind == b"##CG":
            cycles, data, invalid = _numbers(path, content, block, start + 8, "<Q8xII")
            declared += cycles * max(1, (data + invalid) // 8)
            check_size(path, declared, "declares")
        elif block.kind == b"##DZ":
            unpacked += _unpacked_size(path, content, block, start)
            check_size(path, unpacked // 8, "unpacks to")
        elif block.kind == b"##MD":
            text = content[start : block.address + block.length].upper()
            if b"<!DOCTYPE" in text or b"<!ENTITY" in text:
                _refuse(path, block, "DOCTYPE and entities are not allowed")


def _blocks(path: Path, content: mmap.mmap) -> Iterator[_Block]:
    """All blocks that can be reached, each once."""
    waiting, seen, in_tree = [_FIRST], {_FIRST}, {_FIRST}
    while waiting:
        block = _block(path, content, waiting.pop())
        yield block
        tree = _TREE.get(block.kind, ())
        if block.kind in _LISTS_OF_DATA:
            tree = range(len(block.links))
        for index, target in enumerate(block.links):
            if target == 0 or not _leads_on(block.kind, index):
                continue
            if index in tree:
                if target in in_tree:
                    _refuse(path, block, f"leads to the block at {target}, which is in a list once")
                in_tree.add(target)
            if target not in seen:
                seen.add(target)
                waiting.append(target)
        if len(seen) > MOST_BLOCKS:
            raise TwinError(f"{path}: has more than {MOST_BLOCKS:,} blocks, the most allowed")


def _leads_on(kind: bytes, index: int) -> bool:
    """Whether a link of a block is one: those of a sample reduction may be what they like."""
    return kind != b"##SR" or index < 2


def _block(path: Path, content: mmap.mmap, address: int) -> _Block:
    if address % 8 or address + _HEADER.size > len(content):
        raise TwinError(
            f"{path}: is truncated or damaged: a block should stand at byte {address} of "
            f"{len(content)}"
        )
    kind, _, length, count = _HEADER.unpack_from(content, address)
    block = _Block(address, kind, length, ())
    if kind[:2] != b"##":
        _refuse(path, block, "is no block of MDF 4")
    if address + length > len(content) or _HEADER.size + 8 * count > length:
        _refuse(path, block, f"is truncated: it has {length} bytes and {count} links")
    links = struct.unpack_from(f"<{count}Q", content, address + _HEADER.size)
    return block._replace(links=links)


def _numbers(
    path: Path, content: mmap.mmap, block: _Block, start: int, form: str
) -> tuple[int, ...]:
    if start + struct.calcsize(form) > block.address + block.length:
        _refuse(path, block, f"is too short: it has {block.length} bytes")
    return struct.unpack_from(form, content, start)


def _unpacked_size(path: Path, content: mmap.mmap, block: _Block, start: int) -> int:
    """The bytes in a compressed block, which it declares and does not exceed."""
    kind, size, packed = _numbers(path, content, block, start, "<2xB5xQQ")
    begin = start + 24
    if kind not in (0, 1):
        _refuse(path, block, f"is compressed in way {kind}; allowed: 0 and 1 (deflate)")
    if begin + packed > block.address + block.length or size > 8 * LARGEST_LOG:
        _refuse(path, block, f"declares {size} bytes, packed into {packed}")
    try:
        found = len(zlib.decompressobj().decompress(content[begin : begin + packed], size + 1))
    except zlib.error as error:
        _refuse(path, block, f"is damaged: {reason(error)}")
    if found != size:
        _refuse(path, block, f"declares {size} bytes and has {'more' if found > size else found}")
    return size


def _refuse(path: Path, block: _Block, what: str) -> NoReturn:
    name = block.kind.decode("latin-1")
    raise TwinError(f"{path}: block {name!a} at byte {block.address}: {what}")
