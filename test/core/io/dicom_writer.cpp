#include "core/io/dicom_writer.h"

#include <gdcmDataElement.h>
#include <gdcmSequenceOfItems.h>
#include <gdcmWriter.h>

#include <atomic>
#include <cmath>
#include <cstdio>
#include <numeric>
#include <random>
#include <stdexcept>

namespace usct::test {
namespace {

constexpr const char* kName = "ROE^RICHARDA";
constexpr const char* kId = "PAT-77031";
constexpr const char* kText = "referred by Dr Quux";

gdcm::DataElement element(gdcm::Tag tag, gdcm::VR vr, std::string bytes) {
  if (bytes.size() % 2 != 0) bytes += vr == gdcm::VR::UI ? '\0' : ' ';
  gdcm::DataElement out(tag);
  out.SetVR(vr);
  out.SetByteValue(bytes.data(), static_cast<std::uint32_t>(bytes.size()));
  return out;
}

gdcm::DataElement sequence(gdcm::Tag tag, const std::vector<gdcm::DataSet>& items) {
  gdcm::SmartPointer<gdcm::SequenceOfItems> sequence_items = new gdcm::SequenceOfItems;
  sequence_items->SetLengthToUndefined();
  for (const gdcm::DataSet& data : items) {
    gdcm::Item item;
    item.SetVLToUndefined();
    item.SetNestedDataSet(data);
    sequence_items->AddItem(item);
  }
  gdcm::DataElement out(tag);
  out.SetVR(gdcm::VR::SQ);
  out.SetValue(*sequence_items);
  out.SetVLToUndefined();
  return out;
}

/// Decimal string: at most 16 characters.
std::string decimal(double value) {
  char text[32];
  for (int digits = 15; digits > 0; --digits)
    if (std::snprintf(text, sizeof(text), "%.*g", digits, value) <= 16) return text;
  throw std::logic_error("number too long");
}

template <typename Derived>
std::string decimals(const Eigen::MatrixBase<Derived>& values) {
  std::string out;
  for (Eigen::Index i = 0; i < values.size(); ++i) out += (i > 0 ? "\\" : "") + decimal(values(i));
  return out;
}

std::string stored_pixels(const DicomSlice& slice) {
  std::string bytes;
  for (int row = 0; row < slice.size.y(); ++row)
    for (int column = 0; column < slice.size.x(); ++column) {
      const Eigen::Vector3d p = slice.position_mm +
                                slice.axes.col(0) * (column * slice.spacing_mm.x()) +
                                slice.axes.col(1) * (row * slice.spacing_mm.y());
      const long stored = std::lround((slice.hounsfield(p) - slice.intercept) / slice.slope);
      const long mask = (1L << slice.bits_stored) - 1;
      const long bits =
          (stored & mask) | (static_cast<long>(slice.unused_bits) << slice.bits_stored);
      for (int byte = 0; byte < slice.bits_allocated / 8; ++byte)
        bytes += static_cast<char>((bits >> (8 * byte)) & 0xff);
    }
  return bytes;
}

std::string unique_uid() {
  static std::atomic<int> count{0};
  return "1.2.826.0.1.3680043.2.5." + std::to_string(++count);
}

gdcm::DataSet common(const DicomSlice& slice) {
  using gdcm::VR;
  gdcm::DataSet data;
  data.Insert(element({0x0008, 0x0008}, VR::CS, slice.image_type));
  data.Insert(element({0x0008, 0x0016}, VR::UI, slice.sop_class));
  data.Insert(element({0x0008, 0x0018}, VR::UI, unique_uid()));
  data.Insert(element({0x0008, 0x0050}, VR::SH, kId));
  data.Insert(element({0x0008, 0x0060}, VR::CS, slice.modality));
  data.Insert(element({0x0008, 0x103e}, VR::LO, kText));
  data.Insert(element({0x0010, 0x0010}, VR::PN, kName));
  data.Insert(element({0x0010, 0x0020}, VR::LO, kId));
  data.Insert(element({0x0010, 0x4000}, VR::LT, kText));
  data.Insert(element({0x0018, 0x0050}, VR::DS, "9.5"));  // thickness: not the spacing
  data.Insert(element({0x0020, 0x000d}, VR::UI, "1.2.826.0.1.3680043.2.8"));
  data.Insert(element({0x0020, 0x000e}, VR::UI, slice.series_uid));
  data.Insert(element({0x0020, 0x0011}, VR::IS, std::to_string(slice.series_number)));
  data.Insert(element({0x0020, 0x0013}, VR::IS, std::to_string(slice.instance_number)));
  data.Insert(element({0x0020, 0x0052}, VR::UI, slice.frame_of_reference_uid));
  data.Insert(element({0x0020, 0x4000}, VR::LT, kText));
  data.Insert(element({0x0028, 0x0002}, VR::US, short_bytes(1)));
  data.Insert(element({0x0028, 0x0004}, VR::CS, "MONOCHROME2"));
  data.Insert(element({0x0028, 0x0010}, VR::US, short_bytes(slice.size.y())));
  data.Insert(element({0x0028, 0x0011}, VR::US, short_bytes(slice.size.x())));
  data.Insert(element({0x0028, 0x0100}, VR::US, short_bytes(slice.bits_allocated)));
  data.Insert(element({0x0028, 0x0101}, VR::US, short_bytes(slice.bits_stored)));
  data.Insert(element({0x0028, 0x0102}, VR::US, short_bytes(slice.bits_stored - 1)));
  data.Insert(element({0x0028, 0x0103}, VR::US, short_bytes(slice.is_signed ? 1 : 0)));
  return data;
}

void write_file(const std::filesystem::path& path, const DicomSlice& slice, gdcm::DataSet data) {
  for (const auto& [tag, bytes] : slice.changes) {
    const gdcm::VR vr =
        data.FindDataElement(tag) ? data.GetDataElement(tag).GetVR() : gdcm::VR(gdcm::VR::SS);
    data.Remove(tag);
    if (bytes) data.Insert(element(tag, vr, *bytes));
  }
  gdcm::Writer writer;
  writer.SetFileName(path.c_str());
  writer.GetFile().SetDataSet(data);
  gdcm::FileMetaInformation& meta = writer.GetFile().GetHeader();
  meta.SetDataSetTransferSyntax(gdcm::TransferSyntax::ExplicitVRLittleEndian);
  meta.Insert(element({0x0002, 0x0002}, gdcm::VR::UI, slice.sop_class));
  meta.Insert(element({0x0002, 0x0003}, gdcm::VR::UI, unique_uid()));
  meta.Insert(element({0x0002, 0x0010}, gdcm::VR::UI, "1.2.840.10008.1.2.1"));
  writer.SetCheckFileMetaInformation(false);
  if (!writer.Write()) throw std::runtime_error("cannot write " + path.string());
}

}  // namespace

std::string short_bytes(int value) {
  return {static_cast<char>(value & 0xff), static_cast<char>((value >> 8) & 0xff)};
}

void write_dicom(const std::filesystem::path& path, const DicomSlice& slice) {
  using gdcm::VR;
  gdcm::DataSet data = common(slice);
  data.Insert(element({0x0020, 0x0012}, VR::IS, std::to_string(slice.acquisition_number)));
  data.Insert(element({0x0020, 0x0032}, VR::DS, decimals(slice.position_mm)));
  data.Insert(element({0x0020, 0x0037}, VR::DS, decimals(slice.axes)));
  data.Insert(element({0x0028, 0x0030}, VR::DS,
                      decimals(Eigen::Vector2d(slice.spacing_mm.y(), slice.spacing_mm.x()))));
  data.Insert(element({0x0028, 0x1052}, VR::DS, decimal(slice.intercept)));
  data.Insert(element({0x0028, 0x1053}, VR::DS, decimal(slice.slope)));
  data.Insert(element({0x0028, 0x1054}, VR::LO, slice.rescale_type));
  data.Insert(
      element({0x7fe0, 0x0010}, slice.bits_allocated > 8 ? VR::OW : VR::OB, stored_pixels(slice)));
  write_file(path, slice, std::move(data));
}

void write_enhanced_dicom(const std::filesystem::path& path,
                          const std::vector<DicomSlice>& frames) {
  using gdcm::VR;
  DicomSlice first = frames.front();
  first.sop_class = "1.2.840.10008.5.1.4.1.1.2.1";
  gdcm::DataSet data = common(first);
  data.Insert(element({0x0028, 0x0008}, VR::IS, std::to_string(frames.size())));

  const auto macro = [](gdcm::Tag tag, std::vector<gdcm::DataElement> elements) {
    gdcm::DataSet item;
    for (const gdcm::DataElement& e : elements) item.Insert(e);
    return sequence(tag, {item});
  };
  gdcm::DataSet shared;
  shared.Insert(macro({0x0020, 0x9116}, {element({0x0020, 0x0037}, VR::DS, decimals(first.axes))}));
  shared.Insert(
      macro({0x0028, 0x9110},
            {element({0x0028, 0x0030}, VR::DS,
                     decimals(Eigen::Vector2d(first.spacing_mm.y(), first.spacing_mm.x())))}));
  data.Insert(sequence({0x5200, 0x9229}, {shared}));

  std::vector<gdcm::DataSet> per_frame;
  std::string pixels;
  for (const DicomSlice& frame : frames) {
    gdcm::DataSet groups;
    groups.Insert(
        macro({0x0020, 0x9113}, {element({0x0020, 0x0032}, VR::DS, decimals(frame.position_mm))}));
    groups.Insert(macro({0x0020, 0x9111}, {element({0x0020, 0x9156}, VR::US,
                                                   short_bytes(frame.acquisition_number))}));
    groups.Insert(macro({0x0018, 0x9329}, {element({0x0008, 0x9007}, VR::CS, frame.image_type)}));
    groups.Insert(
        macro({0x0028, 0x9145}, {element({0x0028, 0x1052}, VR::DS, decimal(frame.intercept)),
                                 element({0x0028, 0x1053}, VR::DS, decimal(frame.slope)),
                                 element({0x0028, 0x1054}, VR::LO, frame.rescale_type)}));
    per_frame.push_back(groups);
    pixels += stored_pixels(frame);
  }
  data.Insert(sequence({0x5200, 0x9230}, per_frame));
  data.Insert(element({0x7fe0, 0x0010}, VR::OW, pixels));
  write_file(path, first, std::move(data));
}

std::vector<std::string> patient_identifiers() {
  return {"ROE", "RICHARDA", "77031", "Quux", "referred"};
}

std::vector<DicomSlice> slices_of(const Grid& grid) {
  std::vector<DicomSlice> slices;
  for (int k = 0; k < grid.size.z(); ++k) {
    DicomSlice slice;
    slice.position_mm = grid.physical_from_index(Eigen::Vector3d(0, 0, k));
    slice.axes = grid.direction.leftCols<2>();
    slice.spacing_mm = grid.spacing_mm.head<2>();
    slice.size = grid.size.head<2>();
    slices.push_back(slice);
  }
  return slices;
}

void write_shuffled(const std::filesystem::path& folder, std::vector<DicomSlice> slices) {
  std::mt19937 random(5);
  std::vector<int> numbers(slices.size());
  std::iota(numbers.begin(), numbers.end(), 1);
  std::shuffle(numbers.begin(), numbers.end(), random);
  std::shuffle(slices.begin(), slices.end(), random);
  for (std::size_t i = 0; i < slices.size(); ++i) {
    slices[i].instance_number = numbers[i];
    write_dicom(folder / ("slice_" + std::to_string(i) + ".dcm"), slices[i]);
  }
}

}  // namespace usct::test
