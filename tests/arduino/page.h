// Reads the test vectors from docs/link.md, so that no byte of them is copied.
#ifndef PAGE_H
#define PAGE_H

#include <cstdint>
#include <map>
#include <string>
#include <vector>

typedef std::vector<uint8_t> Bytes;

// A row of the table "Frames to refuse".
struct Refusal {
    Bytes bytes;
    bool toController;
    std::string error;
};

// The page docs/link.md.
struct Page {
    // The bytes of each vector by its heading, then by the name of the line: body, crc or frame.
    std::map<std::string, std::map<std::string, Bytes>> vectors;
    std::vector<Refusal> refusals;
    // All lines of the page.
    std::vector<std::string> lines;

    // Returns true if a line of the page contains `text`.
    bool has(const std::string &text) const;
};

// Reads the page once; `LINK_PAGE` is its path.
const Page &page();

#endif
