#include <expat.h>

#include <memory>
#include <string_view>

#include "io/bytes.h"
#include "io/ultrasound/igsio_format.h"
#include "text.h"
#include "us_ct_registration/error.h"
#include "us_ct_registration/io/ultrasound/igsio.h"

namespace usct {
namespace {

/// Collects the Transform elements of CoordinateDefinitions. The parser is written in C, and no
/// exception may pass through it; errors are kept until it has returned.
class CalibrationReader {
 public:
  explicit CalibrationReader(std::string source) : source_(std::move(source)) {}

  IgsioTransforms read(const io::Bytes& bytes) {
    const std::unique_ptr<XML_ParserStruct, decltype(&XML_ParserFree)> parser(
        XML_ParserCreate(nullptr), &XML_ParserFree);
    parser_ = parser.get();
    XML_SetUserData(parser_, this);
    XML_SetElementHandler(parser_, &CalibrationReader::start, &CalibrationReader::end);
    const auto* text = reinterpret_cast<const char*>(bytes.data());
    const XML_Status status = XML_Parse(parser_, text, static_cast<int>(bytes.size()), XML_TRUE);
    if (!failure_.empty()) throw InputError(source_, failure_);
    if (status != XML_STATUS_OK)
      throw InputError(source_, "line " + std::to_string(XML_GetCurrentLineNumber(parser_)) + ": " +
                                    XML_ErrorString(XML_GetErrorCode(parser_)));
    if (!found_) throw InputError(source_, "has no element CoordinateDefinitions");
    return transforms_;
  }

 private:
  static void start(void* self, const XML_Char* name, const XML_Char** attributes) {
    static_cast<CalibrationReader*>(self)->on_start(name, attributes);
  }
  static void end(void* self, const XML_Char* name) {
    auto& reader = *static_cast<CalibrationReader*>(self);
    if (std::string_view(name) == "CoordinateDefinitions") reader.inside_ = false;
  }

  void on_start(std::string_view name, const XML_Char** attributes) {
    if (name == "CoordinateDefinitions") inside_ = found_ = true;
    if (!inside_ || name != "Transform") return;
    std::map<std::string, std::string> values;
    for (; *attributes != nullptr; attributes += 2) values[attributes[0]] = attributes[1];
    try {
      add(values);
    } catch (const InputError& error) {
      failure_ = error.violation();
      XML_StopParser(parser_, XML_FALSE);
    }
  }

  void add(const std::map<std::string, std::string>& values) {
    const std::string line =
        "Transform in line " + std::to_string(XML_GetCurrentLineNumber(parser_));
    for (const char* attribute : {"From", "To", "Matrix"})
      if (values.count(attribute) == 0)
        throw InputError(source_, line + " has no attribute " + attribute);
    const std::string name = values.at("From") + "To" + values.at("To");
    IgsioTransform transform;
    transform.T = io::parse_affine(values.at("Matrix"), source_, name);
    transform.status = "OK";
    if (!transforms_.emplace(name, transform).second)
      throw InputError(source_, line + ": " + in_quotes(name) + " is given twice");
  }

  std::string source_;
  XML_Parser parser_ = nullptr;
  IgsioTransforms transforms_;
  std::string failure_;
  bool inside_ = false;
  bool found_ = false;
};

}  // namespace

IgsioTransforms read_plus_calibration(const std::filesystem::path& path) {
  return CalibrationReader(path.string()).read(io::read_text_bytes(path));
}

}  // namespace usct
