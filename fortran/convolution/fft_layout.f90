!> How the transforms of a convolution are laid out in memory, and how much of it they take.
module hc_fft_layout
  use hc_precision, only: wp
  use hc_communicator, only: communicator_t
  implicit none
  private

  public :: convolution_memory, transform_memory, block_width, even

  !> Bytes that one component of a column block should take, so that blocks stay in cache.
  integer, parameter :: block_bytes = 32768

contains

  !> Count the bytes that a convolution takes: spectra, row transforms, buffers.
  pure integer(selected_int_kind(18)) function convolution_memory(extent, padded, n_kernel, n_component, threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Transform lengths
    integer, intent(in) :: padded(2)
    !> Number of kernels, of components of the fields, of threads
    integer, intent(in) :: n_kernel, n_component, threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: leading, n_row, length, width

    width = block_width(padded(2))
    leading = leading_size(padded)
    n_row = even(extent(2))
    length = padded(2)
    convolution_memory = n_kernel*leading*length + 2*n_component*leading*n_row &
                         + threads*(4*padded(1) + 4*n_component*width*length)
    convolution_memory = convolution_memory*(storage_size(1.0_wp)/8)
  end function convolution_memory

  !> Count the additional bytes while the kernels of a padded convolution are transformed: their rows, and on several ranks
  !> the columns that they exchange them for.
  pure integer(selected_int_kind(18)) function transform_memory(extent, padded, n_kernel, ranks)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Transform lengths
    integer, intent(in) :: padded(2)
    !> Number of kernels
    integer, intent(in) :: n_kernel
    !> Ranks that share the rows; absent: one
    type(communicator_t), intent(in), optional :: ranks
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: numbers
    integer :: width, n_block

    numbers = leading_size(padded)*int(even(extent(2)), long)
    if (present(ranks)) then
      if (ranks%size > 1) then
        width = block_width(padded(2))
        n_block = leading_size(padded)/width
        numbers = leading_size(padded)*int(even(ranks%last_row(extent(2)) - ranks%first_row(extent(2)) + 1), long) &
                  + width*(ranks%last_item(n_block) - ranks%first_item(n_block) + 1)*int(even(extent(2)), long)
      end if
    end if
    transform_memory = storage_size((1.0_wp, 0.0_wp))/8*n_kernel*numbers
  end function transform_memory

  !> Compute the leading dimension for the frequencies along the first direction, in whole blocks.
  pure integer function leading_size(padded)
    !> Transform lengths
    integer, intent(in) :: padded(2)

    associate (width => block_width(padded(2)))
      leading_size = (padded(1)/2 + width)/width*width
    end associate
  end function leading_size

  !> Round up to an even number: rows are transformed in pairs.
  elemental integer function even(n)
    !> Number
    integer, intent(in) :: n
    even = n + modulo(n, 2)
  end function even

  !> Choose the columns that are transformed together: 4, 8, 12 or 16, so that all transforms begin at addresses
  !> alike modulo 16 bytes, as their common plan expects.
  elemental integer function block_width(length)
    !> Length of a column
    integer, intent(in) :: length
    block_width = 4*min(4, max(1, block_bytes/(64*length)))
  end function block_width

end module hc_fft_layout
