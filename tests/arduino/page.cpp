#include "page.h"

#include <fstream>
#include <sstream>
#include <stdexcept>

namespace {

std::vector<std::string> words(const std::string &line) {
    std::istringstream stream(line);
    std::vector<std::string> all;
    for (std::string word; stream >> word;) {
        all.push_back(word);
    }
    return all;
}

uint8_t byteOf(const std::string &word) {
    size_t used = 0;
    const unsigned long value = std::stoul(word, &used, 16);
    if (used != 2 || word.size() != 2) {
        throw std::runtime_error("docs/link.md: `" + word + "` is no byte");
    }
    return static_cast<uint8_t>(value);
}

// Returns the text of a cell of a table row: `| 1 | 2 |`, counted from 0.
std::string cell(const std::string &row, int index) {
    size_t from = 0;
    for (int i = 0; i <= index; i++) {
        from = row.find('|', from) + 1;
    }
    std::string text = row.substr(from, row.find('|', from) - from);
    text.erase(0, text.find_first_not_of(" `"));
    text.erase(text.find_last_not_of(" `") + 1);
    return text;
}

Page read() {
    Page page;
    std::ifstream file(LINK_PAGE);
    if (!file) {
        throw std::runtime_error(std::string(LINK_PAGE) + " cannot be read");
    }
    std::string section, heading, field;
    for (std::string line; std::getline(file, line);) {
        page.lines.push_back(line);
        if (line.compare(0, 3, "## ") == 0) {
            section = line.substr(3);
            heading.clear();
        } else if (line.compare(0, 5, "### `") == 0) {
            heading = line.substr(5, line.size() - 6);
        } else if (line.compare(0, 3, "```") == 0) {
            field.clear();
        } else if (section == "Golden byte vectors" && !heading.empty()) {
            for (const std::string &word : words(line)) {
                if (line.compare(0, word.size(), word) == 0 &&
                    (word == "body" || word == "crc" || word == "frame")) {
                    field = word;
                } else if (!field.empty()) {
                    page.vectors[heading][field].push_back(byteOf(word));
                }
            }
        } else if (section == "Frames to refuse" && line.compare(0, 3, "| `") == 0) {
            Refusal refusal = {Bytes(), cell(line, 1) == "to controller", cell(line, 2)};
            for (const std::string &word : words(cell(line, 0))) {
                refusal.bytes.push_back(byteOf(word));
            }
            page.refusals.push_back(refusal);
        }
    }
    return page;
}

} // namespace

const Page &page() {
    static const Page read_once = read();
    return read_once;
}

bool Page::has(const std::string &text) const {
    for (const std::string &line : lines) {
        if (line.find(text) != std::string::npos) {
            return true;
        }
    }
    return false;
}
