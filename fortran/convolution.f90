!> Convolutions over a window of the lattice by FFT.
!>
!> A product takes four stages, each cut into independent 1-D transforms with
!> one plan, so that the result does not depend on the number of threads:
!> real transforms along the rows of the window (padding rows are never
!> touched); transforms along the columns in blocks that stay in cache; there,
!> multiplication with the spectra and the inverse transforms at once; inverse
!> real transforms of the rows of the window.
!>
!> Every kernel is even or odd, so that its spectrum is real, or i times real.
module hc_convolution
  use, intrinsic :: iso_c_binding, only: c_ptr, c_null_ptr, c_associated, c_int
  use hc_precision, only: wp
  use hc_error, only: error_t, status, raise
  use hc_fftw, only: fftw_plan_many_dft, fftw_plan_many_dft_r2c, fftw_plan_many_dft_c2r, &
                     fftw_execute_dft, fftw_execute_dft_r2c, fftw_execute_dft_c2r, fftw_destroy_plan, &
                     fftw_forward, fftw_backward, fftw_estimate
  !$ use omp_lib, only: omp_get_thread_num, omp_get_max_threads
  implicit none
  private

  public :: convolution_t, new_convolution, convolution_memory, kernel_source_t, threads_for

  !> Bytes that one component of a column block should take, so that blocks stay in cache.
  integer, parameter :: block_bytes = 32768
  !> Smaller windows are left to one thread: starting the others takes longer than they save.
  integer, parameter :: worth_sharing = 16384
  !> Number of frequencies that are multiplied at a time.
  integer, parameter :: chunk = 128

  !> Plans, spectra and scratch space.
  type :: convolution_t
    !> Spectra (frequency, block, kernel), normalised; those of odd kernels are divided by i.
    !> `frequencies` tells which frequency stands where.
    real(wp), allocatable :: spectrum(:, :, :)
    !> Threads that share the work
    integer :: n_threads = 1
    !> Transform lengths along the two lattice directions
    integer :: padded(2) = 0
    !> Columns in a block, number of blocks
    integer :: width = 0, n_block = 0
    !> Number of columns and rows of the window
    integer, private :: extent(2) = 0
    !> Number of frequencies along the first direction, and the leading dimension that holds them
    integer, private :: n_frequency = 0, leading = 0
    !> The first odd kernel
    integer, private :: first_odd = 0
    type(c_ptr), private :: row_forward = c_null_ptr, row_inverse = c_null_ptr
    type(c_ptr), private :: column_forward = c_null_ptr, column_inverse = c_null_ptr
    !> Row transforms (leading, n_row, component)
    complex(wp), allocatable, private :: work(:, :, :)
    !> One padded row for each thread
    real(wp), allocatable, private :: row_buffer(:, :)
    !> One column block of each component for each thread
    complex(wp), allocatable, private :: block_buffer(:, :, :)
  contains
    !> Sums of weighted convolutions
    procedure :: convolve
    !> Spectra of kernels given at the lattice offsets
    procedure :: transform_kernels
    !> Frequencies of the entries of a block of the spectra
    procedure :: frequencies
    !> The transforms of one scalar product and nothing else
    procedure :: time_transforms
    final :: free_plans
  end type convolution_t

  !> Something that knows the kernels at lattice offsets.
  type, abstract :: kernel_source_t
  contains
    procedure(kernel_row), deferred :: row
  end type kernel_source_t

  abstract interface
    !> All kernels at the offsets of j >= 0 rows and -n...n columns: k(kernel, n + 1 + column)
    pure subroutine kernel_row(self, j, k)
      import :: kernel_source_t, wp
      class(kernel_source_t), intent(in) :: self
      integer, intent(in) :: j
      real(wp), intent(out) :: k(:, :)
    end subroutine kernel_row
  end interface

contains

  !> Plans and scratch space for convolutions over a window; the spectra are still to be set.
  subroutine new_convolution(self, extent, padded, n_kernel, n_component, error, first_odd, n_threads)
    !> Convolution to be set up
    type(convolution_t), intent(out) :: self
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Transform lengths, the first one a multiple of four; 2*extent - 1 at least unless the convolution is periodic
    integer, intent(in) :: padded(2)
    !> Number of kernels, and of components of the fields
    integer, intent(in) :: n_kernel, n_component
    !> Allocated on failure: not enough memory, a length FFTW cannot plan
    type(error_t), allocatable, intent(out) :: error
    !> The first odd kernel; absent: all are even
    integer, intent(in), optional :: first_odd
    !> Threads to use; absent or 0: as many as OpenMP would take, one for a small window
    integer, intent(in), optional :: n_threads

    integer :: stat

    self%n_threads = threads_for(extent, n_threads)
    self%first_odd = n_kernel + 1
    if (present(first_odd)) self%first_odd = first_odd
    self%extent = extent
    self%padded = padded
    self%n_frequency = padded(1)/2 + 1
    self%width = block_width(padded(2))
    self%n_block = (self%n_frequency + self%width - 1)/self%width
    self%leading = self%n_block*self%width
    associate (column => self%width*padded(2))
      ! the columns that only fill up the last block are transformed too: zeros stay zeros
      allocate (self%work(self%leading, extent(2), n_component), &
                self%block_buffer(column, n_component, self%n_threads), source=(0.0_wp, 0.0_wp), stat=stat)
      if (stat == 0) allocate (self%row_buffer(padded(1), self%n_threads), &
                               self%spectrum(column, self%n_block, n_kernel), source=0.0_wp, stat=stat)
    end associate
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the transforms: use a smaller window')
      return
    end if
    call make_plans(self, error)
  end subroutine new_convolution

  !> Threads that a window is worth.
  integer function threads_for(extent, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Threads to use; absent or 0: as many as OpenMP would take, one for a small window
    integer, intent(in), optional :: n_threads

    threads_for = 1
    !$ if (product(extent) >= worth_sharing) threads_for = omp_get_max_threads()
    if (present(n_threads)) then
      !$ if (n_threads > 0) threads_for = n_threads
    end if
  end function threads_for

  !> Bytes that a convolution takes while its kernels are transformed.
  pure integer(selected_int_kind(18)) function convolution_memory(extent, padded, n_kernel, n_component, n_threads)
    !> Number of columns and rows of the window
    integer, intent(in) :: extent(2)
    !> Transform lengths
    integer, intent(in) :: padded(2)
    !> Number of kernels, of components of the fields, of threads
    integer, intent(in) :: n_kernel, n_component, n_threads
    integer, parameter :: long = selected_int_kind(18)
    integer(long) :: leading, n_row, length, width

    width = block_width(padded(2))
    leading = padded(1)/2 + width
    n_row = extent(2)
    length = padded(2)
    convolution_memory = n_kernel*leading*length + 2*(n_component + n_kernel)*leading*n_row &
                         + n_threads*(padded(1) + 2*n_component*width*length)
    convolution_memory = convolution_memory*(storage_size(1.0_wp)/8)
  end function convolution_memory

  !> Columns that are transformed together: 4, 8, 12 or 16, so that all transforms begin at addresses
  !> alike modulo 16 bytes, as their common plan expects.
  elemental integer function block_width(length)
    !> Length of a column
    integer, intent(in) :: length
    block_width = 4*min(4, max(1, block_bytes/(64*length)))
  end function block_width

  subroutine make_plans(self, error)
    class(convolution_t), intent(inout) :: self
    type(error_t), allocatable, intent(out) :: error
    integer(c_int) :: length(1), n1, width

    n1 = self%padded(1)
    width = self%width
    ! FFTW_ESTIMATE: the same plan, and the same result, in every run
    !$omp critical (hc_fftw_planner)
    length = n1
    self%row_forward = fftw_plan_many_dft_r2c(1_c_int, length, 1_c_int, self%row_buffer, length, 1_c_int, n1, &
                                              self%work, length, 1_c_int, n1, fftw_estimate)
    self%row_inverse = fftw_plan_many_dft_c2r(1_c_int, length, 1_c_int, self%work, length, 1_c_int, n1, &
                                              self%row_buffer, length, 1_c_int, n1, fftw_estimate)
    length = self%padded(2)
    self%column_forward = fftw_plan_many_dft(1_c_int, length, width, self%block_buffer, length, width, 1_c_int, &
                                             self%block_buffer, length, width, 1_c_int, fftw_forward, fftw_estimate)
    self%column_inverse = fftw_plan_many_dft(1_c_int, length, width, self%block_buffer, length, width, 1_c_int, &
                                             self%block_buffer, length, width, 1_c_int, fftw_backward, fftw_estimate)
    !$omp end critical (hc_fftw_planner)
    if (.not. (c_associated(self%row_forward) .and. c_associated(self%row_inverse) .and. &
               c_associated(self%column_forward) .and. c_associated(self%column_inverse))) then
      call raise(error, status%resources, 'FFTW could not plan the transforms of this window')
    end if
  end subroutine make_plans

  !> Spectra of kernels that are given at the lattice offsets, for a padded convolution.
  !>
  !> A row of negative index is the reverse of its mirror image, up to the sign
  !> of an odd kernel, so that its transform is the conjugate: half of the
  !> kernel values and of the row transforms suffice.
  subroutine transform_kernels(self, source, error)
    class(convolution_t), intent(inout) :: self
    !> The kernels
    class(kernel_source_t), intent(in) :: source
    !> Allocated on failure: not enough memory
    type(error_t), allocatable, intent(out) :: error

    complex(wp), allocatable :: rows(:, :, :)
    real(wp), allocatable :: kernel(:, :)
    real(wp) :: scale, sign
    integer :: n(2), n_kernel, j, m, b, thread, stat, from, to

    n = self%extent
    n_kernel = size(self%spectrum, 3)
    scale = 1.0_wp/(real(self%padded(1), wp)*real(self%padded(2), wp))
    allocate (rows(self%leading, 0:n(2) - 1, n_kernel), stat=stat)
    if (stat /= 0) then
      call raise(error, status%resources, 'not enough memory for the spectra of the kernels: use a smaller window')
      return
    end if

    thread = 1
    !$omp parallel num_threads(self%n_threads) private(j, m, b, kernel, sign, from, to) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    allocate (kernel(n_kernel, 1 - n(1):n(1) - 1))
    !$omp do schedule(dynamic)
    do j = 0, n(2) - 1
      call source%row(j, kernel)
      do m = 1, n_kernel
        self%row_buffer(:, thread) = 0.0_wp
        self%row_buffer(:n(1), thread) = scale*kernel(m, 0:)
        self%row_buffer(self%padded(1) - n(1) + 2:, thread) = scale*kernel(m, :-1)
        call fftw_execute_dft_r2c(self%row_forward, self%row_buffer(:, thread), rows(:, j, m))
        rows(self%n_frequency + 1:, j, m) = 0.0_wp
      end do
    end do
    !$omp end do
    !$omp do schedule(dynamic)
    do b = 1, self%n_block
      from = (b - 1)*self%width + 1
      to = b*self%width
      do m = 1, n_kernel
        sign = merge(1.0_wp, -1.0_wp, m < self%first_odd)
        associate (buffer => self%block_buffer(:, 1, thread), w => self%width)
          buffer = 0.0_wp
          do j = 0, n(2) - 1
            buffer(j*w + 1:(j + 1)*w) = rows(from:to, j, m)
            if (j > 0) buffer((self%padded(2) - j)*w + 1:(self%padded(2) - j + 1)*w) = sign*conjg(rows(from:to, j, m))
          end do
          call fftw_execute_dft(self%column_forward, buffer, buffer)
          if (m < self%first_odd) then
            self%spectrum(:, b, m) = real(buffer, wp)
          else
            self%spectrum(:, b, m) = aimag(buffer)
          end if
        end associate
      end do
    end do
    !$omp end do
    !$omp end parallel
  end subroutine transform_kernels

  !> Indices of the frequencies of a block, f(1) = 0...padded(1)/2, f(2) = 0...padded(2)-1.
  pure function frequencies(self, b) result(f)
    class(convolution_t), intent(in) :: self
    !> Index of the block
    integer, intent(in) :: b
    !> Frequency indices (2, width*padded(2)); f(1) beyond padded(1)/2 is mere filling
    integer, allocatable :: f(:, :)
    integer :: column, row

    allocate (f(2, self%width*self%padded(2)))
    do row = 1, self%padded(2)
      do column = 1, self%width
        f(:, (row - 1)*self%width + column) = [(b - 1)*self%width + column - 1, row - 1]
      end do
    end do
  end function frequencies

  !> result(:, :, o) = sum over i of kernel(o, i) * field(:, :, i)
  subroutine convolve(self, kernel, field, result)
    class(convolution_t), intent(inout) :: self
    !> Number of the kernel (onto, from), negative to reverse its sign
    integer, intent(in) :: kernel(:, :)
    !> Fields to be convolved (n_col, n_row, from)
    real(wp), intent(in), contiguous :: field(:, :, :)
    !> Sums of the convolutions (n_col, n_row, onto)
    real(wp), intent(out), contiguous :: result(:, :, :)

    integer :: n(2), i, o, row, b, thread

    n = self%extent
    thread = 1
    !$omp parallel num_threads(self%n_threads) private(i, o, row, b) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    self%row_buffer(n(1) + 1:, thread) = 0.0_wp
    do i = 1, size(field, 3)
      !$omp do schedule(static)
      do row = 1, n(2)
        ! rows off the contact need no transform
        if (all(abs(field(:, row, i)) <= 0.0_wp)) then
          self%work(:self%n_frequency, row, i) = 0.0_wp
        else
          self%row_buffer(:n(1), thread) = field(:, row, i)
          call fftw_execute_dft_r2c(self%row_forward, self%row_buffer(:, thread), self%work(:, row, i))
        end if
      end do
      !$omp end do nowait
    end do
    !$omp barrier
    !$omp do schedule(static)
    do b = 1, self%n_block
      call convolve_block(self, b, kernel, self%block_buffer(:, :, thread))
    end do
    !$omp end do
    do o = 1, size(result, 3)
      !$omp do schedule(static)
      do row = 1, n(2)
        call fftw_execute_dft_c2r(self%row_inverse, self%work(:, row, o), self%row_buffer(:, thread))
        result(:, row, o) = self%row_buffer(:n(1), thread)
      end do
      !$omp end do nowait
    end do
    !$omp end parallel
  end subroutine convolve

  !> Transform a block of columns, multiply with the spectra, transform back.
  subroutine convolve_block(self, b, kernel, buffer)
    class(convolution_t), intent(inout) :: self
    !> Index of the block
    integer, intent(in) :: b
    !> Number of the kernel (onto, from), negative to reverse its sign
    integer, intent(in) :: kernel(:, :)
    !> Scratch (width*padded(2), component)
    complex(wp), intent(inout), contiguous :: buffer(:, :)

    integer :: n_row, w, i, o, first

    w = self%width
    n_row = self%extent(2)
    first = (b - 1)*w + 1
    do i = 1, size(kernel, 2)
      call copy_columns(w, n_row, self%leading, w, self%work(first, 1, i), buffer(:, i))
      buffer(n_row*w + 1:, i) = 0.0_wp
      call fftw_execute_dft(self%column_forward, buffer(:, i), buffer(:, i))
    end do

    if (size(kernel) == 1 .and. kernel(1, 1) > 0 .and. kernel(1, 1) < self%first_odd) then
      call scale(size(buffer, 1), self%spectrum(:, b, kernel(1, 1)), buffer(:, 1))
    else
      call multiply(self, b, kernel, buffer)
    end if

    do o = 1, size(kernel, 1)
      call fftw_execute_dft(self%column_inverse, buffer(:, o), buffer(:, o))
      call copy_columns(w, n_row, w, self%leading, buffer(:, o), self%work(first, 1, o))
    end do
  end subroutine convolve_block

  !> A single even kernel, the whole operator of frictionless contact.
  pure subroutine scale(n, spectrum, field)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Spectrum of the kernel
    real(wp), intent(in) :: spectrum(n)
    !> Transformed field
    complex(wp), intent(inout) :: field(n)
    integer :: f

    do f = 1, n
      field(f) = cmplx(spectrum(f)*real(field(f), wp), spectrum(f)*aimag(field(f)), wp)
    end do
  end subroutine scale

  !> Columns of a matrix from one place to another; their number is a multiple of four.
  pure subroutine copy_columns(width, n_row, from_leading, onto_leading, from, onto)
    !> Number of columns and rows
    integer, intent(in) :: width, n_row
    !> Distance of two rows where they are and where they go
    integer, intent(in) :: from_leading, onto_leading
    !> Where they are and where they go
    complex(wp), intent(in) :: from(from_leading*(n_row - 1) + width)
    complex(wp), intent(inout) :: onto(onto_leading*(n_row - 1) + width)
    integer :: row, k, i, o

    ! in pieces of fixed length, so that short rows do not cost a call each
    do row = 0, n_row - 1
      i = row*from_leading
      o = row*onto_leading
      do k = 1, width, 4
        onto(o + k:o + k + 3) = from(i + k:i + k + 3)
      end do
    end do
  end subroutine copy_columns

  !> Up to three fields and any kernels.
  subroutine multiply(self, b, kernel, buffer)
    class(convolution_t), intent(in) :: self
    !> Index of the block
    integer, intent(in) :: b
    !> Number of the kernel (onto, from), negative to reverse its sign
    integer, intent(in) :: kernel(:, :)
    !> Transformed fields, replaced by the results
    complex(wp), intent(inout), contiguous :: buffer(:, :)

    integer, parameter :: plain = 1, rotated = 2
    !> Fields as they are and times i (frequency, from)
    complex(wp) :: field(chunk, 3, 2)
    integer :: i, o, start, last, m, n_from, turn(3), k(3)
    real(wp) :: sign(3)

    n_from = size(kernel, 2)
    do start = 1, size(buffer, 1), chunk
      last = min(start + chunk - 1, size(buffer, 1))
      m = last - start + 1
      do i = 1, n_from
        field(:m, i, plain) = buffer(start:last, i)
        if (any(abs(kernel(:, i)) >= self%first_odd)) call rotate(m, field(:, i, plain), field(:, i, rotated))
      end do
      do o = 1, size(kernel, 1)
        k(:n_from) = abs(kernel(o, :))
        sign(:n_from) = merge(1.0_wp, -1.0_wp, kernel(o, :) > 0)
        turn(:n_from) = merge(rotated, plain, k(:n_from) >= self%first_odd)
        select case (n_from)
        case (1)
          call add_1(m, sign, self%spectrum(start:last, b, k(1)), field(:, 1, turn(1)), buffer(start:last, o))
        case (2)
          call add_2(m, sign, self%spectrum(start:last, b, k(1)), field(:, 1, turn(1)), &
                     self%spectrum(start:last, b, k(2)), field(:, 2, turn(2)), buffer(start:last, o))
        case default
          call add_3(m, sign, self%spectrum(start:last, b, k(1)), field(:, 1, turn(1)), &
                     self%spectrum(start:last, b, k(2)), field(:, 2, turn(2)), &
                     self%spectrum(start:last, b, k(3)), field(:, 3, turn(3)), buffer(start:last, o))
        end select
      end do
    end do
  end subroutine multiply

  !> A field times i.
  pure subroutine rotate(n, field, rotated)
    !> Number of frequencies
    integer, intent(in) :: n
    complex(wp), intent(in) :: field(n)
    complex(wp), intent(inout) :: rotated(n)
    integer :: f

    do f = 1, n
      rotated(f) = cmplx(-aimag(field(f)), real(field(f), wp), wp)
    end do
  end subroutine rotate

  !> total = sign * spectrum * field
  pure subroutine add_1(n, sign, s_1, f_1, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Sign and spectrum of the kernel
    real(wp), intent(in) :: sign(1), s_1(n)
    !> Transformed field and result
    complex(wp), intent(in) :: f_1(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      total(f) = cmplx(a*real(f_1(f), wp), a*aimag(f_1(f)), wp)
    end do
  end subroutine add_1

  !> total = sum over two fields of sign * spectrum * field
  pure subroutine add_2(n, sign, s_1, f_1, s_2, f_2, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(2), s_1(n), s_2(n)
    !> Transformed fields and result
    complex(wp), intent(in) :: f_1(n), f_2(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a, b
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp), a*aimag(f_1(f)) + b*aimag(f_2(f)), wp)
    end do
  end subroutine add_2

  !> total = sum over three fields of sign * spectrum * field
  pure subroutine add_3(n, sign, s_1, f_1, s_2, f_2, s_3, f_3, total)
    !> Number of frequencies
    integer, intent(in) :: n
    !> Signs and spectra of the kernels
    real(wp), intent(in) :: sign(3), s_1(n), s_2(n), s_3(n)
    !> Transformed fields and result
    complex(wp), intent(in) :: f_1(n), f_2(n), f_3(n)
    complex(wp), intent(inout) :: total(n)
    real(wp) :: a, b, c
    integer :: f

    do f = 1, n
      a = sign(1)*s_1(f)
      b = sign(2)*s_2(f)
      c = sign(3)*s_3(f)
      total(f) = cmplx(a*real(f_1(f), wp) + b*real(f_2(f), wp) + c*real(f_3(f), wp), &
                       a*aimag(f_1(f)) + b*aimag(f_2(f)) + c*aimag(f_3(f)), wp)
    end do
  end subroutine add_3

  !> Run the transforms of one scalar product and nothing else, to compare times with.
  subroutine time_transforms(self)
    class(convolution_t), intent(inout) :: self
    integer :: row, b, thread

    thread = 1
    !$omp parallel num_threads(self%n_threads) private(row, b) firstprivate(thread)
    !$ thread = omp_get_thread_num() + 1
    !$omp do schedule(static)
    do row = 1, self%extent(2)
      call fftw_execute_dft_r2c(self%row_forward, self%row_buffer(:, thread), self%work(:, row, 1))
    end do
    !$omp end do
    !$omp do schedule(static)
    do b = 1, self%n_block
      call fftw_execute_dft(self%column_forward, self%block_buffer(:, 1, thread), self%block_buffer(:, 1, thread))
      call fftw_execute_dft(self%column_inverse, self%block_buffer(:, 1, thread), self%block_buffer(:, 1, thread))
    end do
    !$omp end do
    !$omp do schedule(static)
    do row = 1, self%extent(2)
      call fftw_execute_dft_c2r(self%row_inverse, self%work(:, row, 1), self%row_buffer(:, thread))
    end do
    !$omp end do
    !$omp end parallel
  end subroutine time_transforms

  impure elemental subroutine free_plans(self)
    type(convolution_t), intent(inout) :: self

    !$omp critical (hc_fftw_planner)
    if (c_associated(self%row_forward)) call fftw_destroy_plan(self%row_forward)
    if (c_associated(self%row_inverse)) call fftw_destroy_plan(self%row_inverse)
    if (c_associated(self%column_forward)) call fftw_destroy_plan(self%column_forward)
    if (c_associated(self%column_inverse)) call fftw_destroy_plan(self%column_inverse)
    !$omp end critical (hc_fftw_planner)
    self%row_forward = c_null_ptr
    self%row_inverse = c_null_ptr
    self%column_forward = c_null_ptr
    self%column_inverse = c_null_ptr
  end subroutine free_plans

end module hc_convolution
